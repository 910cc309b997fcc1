// The sources of the monitor with another DBC file (other.dbc). It shows cells, faults, a contactor and a new message
// without any code for them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "can_messages.hpp"
#include "monitor/history.hpp"
#include "monitor/pack_view.hpp"
#include "monitor/results.hpp"
#include "monitor/screen.hpp"

namespace bms::monitor {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class OtherBus : public ::testing::Test {
 protected:
  template <class Message>
  void send(const Message& message) {
    bus_.receive(to_bus_frame(message.frame(counter_), time_us_));
    counter_ = can::next(counter_);
  }
  void send_cells() {
    can::CellVoltages1 a;
    a.cell1 = 3.301F;
    a.cell2 = 3.302F;
    a.cell3 = 3.271F;
    a.cell4 = 3.304F;
    can::CellVoltages2 b;
    b.cell5 = 3.305F;
    b.cell6 = 3.306F;
    b.cell7 = 3.307F;
    b.cell8 = 3.318F;
    can::CellVoltages3 c;
    c.cell9 = 3.309F;  // cell 10 is invalid
    c.cell11 = 3.311F;
    c.cell12 = 3.312F;
    send(a);
    send(b);
    send(c);
  }
  std::string text(std::size_t columns, std::size_t rows) const {
    return plain_text(screen(bus_, {"can0", 0, 0, 0, false}, {columns, rows}));
  }

  BusState bus_;
  std::uint8_t counter_ = 0;
  std::int64_t time_us_ = 0;
};

TEST_F(OtherBus, ShowsCellsAsBarsWithLowestHighestAndDifference) {
  EXPECT_THAT(text(80, 24), Not(HasSubstr("Cells")));
  send_cells();
  EXPECT_THAT(text(80, 24), HasSubstr("Cells    min 3.271 V (cell 3)  max 3.318 V (cell 8)  delta 47 mV"));
  EXPECT_THAT(text(80, 24), HasSubstr("  8  3.318 ########"));
  EXPECT_THAT(text(80, 24), HasSubstr(" 10      -"));
  EXPECT_THAT(text(80, 24), Not(HasSubstr(" 13 "))) << "a pack of twelve cells";
  const PackView view = pack_view(bus_);
  EXPECT_EQ(view.cells().count, 11U);
  EXPECT_EQ(view.cells_v.size(), 12U);
  EXPECT_EQ(point_of(bus_).cell_count, 12);
  EXPECT_EQ(nlohmann::json::parse(json_of(bus_, {}))["pack"]["cells_v"][2], 3.271);
}

TEST_F(OtherBus, NamesTheActiveFaultsAndTheStateOfTheContactors) {
  can::Faults faults;
  send(faults);
  EXPECT_THAT(text(80, 24), HasSubstr("Faults   none"));
  faults.short_circuit = 1;
  faults.overtemperature = 1;
  faults.first_cause = 2;
  send(faults);
  EXPECT_THAT(text(80, 24), HasSubstr("Faults   ShortCircuit  More than a fuse can bear.\n         Overtemperature  "
                                      "Too hot.\n         FirstCause short circuit\n"));
  EXPECT_THAT(text(80, 8), HasSubstr("Faults   ShortCircuit, Overtemperature\n")) << "one line on a small screen";
  EXPECT_THAT(status_line(bus_, {}), HasSubstr("FAULT ShortCircuit  FAULT Overtemperature"));
  EXPECT_EQ(nlohmann::json::parse(json_of(bus_, {}))["pack"]["faults"],
            (nlohmann::json{"ShortCircuit", "Overtemperature"}));
  can::ContactorState contactor;
  contactor.state = 3;
  contactor.main_plus = 1;
  send(contactor);
  EXPECT_THAT(text(80, 24), HasSubstr("Contactor drive, MainPlus\n"));
}

TEST_F(OtherBus, ShowsAMessageThatIsOnlyInThisDbcFile) {
  can::Novelty novelty;
  novelty.depth = -12.5F;
  send(novelty);
  EXPECT_THAT(text(80, 40), HasSubstr("Depth                    -12.5 mm"));
  EXPECT_THAT(csv_head(), HasSubstr(",Novelty.Depth [mm]"));
  EXPECT_THAT(csv_row(bus_), HasSubstr(",-12.5"));
  EXPECT_EQ(nlohmann::json::parse(json_of(bus_, {}))["messages"]["Novelty"]["signals"]["Depth"]["value"], -12.5);
}

TEST_F(OtherBus, TheCycleTimeOfTheDbcFileMakesAMessageStale) {
  send_cells();
  bus_.advance_time(300'001);
  EXPECT_TRUE(bus_.stale(BusState::find("CellVoltages1"))) << "three times a tenth of a second";
  EXPECT_FALSE(bus_.stale(BusState::find("CellVoltages2"))) << "without a cycle time";
}

}  // namespace
}  // namespace bms::monitor
