// Updates of a depot's trucks: one at a time per bus, resumable, with a table of what runs where.
#include "update/depot_update.hpp"

#include <gmock/gmock.h>

#include <mutex>

#include "files/bad_input.hpp"
#include "files/temporary_folder.hpp"
#include "files/text_file.hpp"

namespace bms::update {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;

class DepotUpdate : public ::testing::Test {
 protected:
  std::filesystem::path table(const std::string& text) {
    files::write_file(folder.path() / "depot.csv", text);
    return folder.path() / "depot.csv";
  }
  std::vector<TruckRow> run(const std::filesystem::path& list, const std::string& image = "image 1") {
    worked_on.clear();
    return update_trucks(
        read_trucks(list), image, folder.path() / "out.csv",
        [&](const Truck& truck) {
          const std::lock_guard lock(mutex);
          worked_on.push_back(truck.name);
          if (truck.name == broken) throw std::runtime_error("the adapter is gone");
          UpdateResult r;
          r.kind = kind;
          r.from = "0.2.0";
          r.to = "0.3.0";
          r.outcome = truck.name == returns ? UpdateResult::Outcome::returned : UpdateResult::Outcome::done;
          r.reason = truck.name == returns ? "the new image did not confirm itself" : "";
          return r;
        },
        [](const TruckRow&) {});
  }
  std::string out() { return files::read_file(folder.path() / "out.csv"); }

  files::TemporaryFolder folder;
  std::mutex mutex;
  std::vector<std::string> worked_on;
  std::string broken, returns;
  boot::Kind kind = boot::Kind::application;
};

TEST_F(DepotUpdate, ReadsTheManifestOfTheFleet) {
  const auto trucks = read_trucks(
      table("recording,truck,cell_index,bus,key\na.csv,T1,1,can0,keys/t1\nb.csv,T1,2,can0,\n\nc.csv,T2,1,,\n"
            "d.csv,\"T 3, old\",1,slcan:/dev/ttyACM0,\n"));
  ASSERT_EQ(trucks.size(), 2U);
  EXPECT_EQ(trucks[0].name, "T1");
  EXPECT_EQ(trucks[0].bus, "can0");
  EXPECT_EQ(trucks[0].key, folder.path() / "keys/t1");
  EXPECT_EQ(trucks[1].name, "T 3, old");
  EXPECT_TRUE(trucks[1].key.empty());
}

TEST_F(DepotUpdate, BadTablesAreRefusedInOneLine) {
  EXPECT_THROW(read_trucks(folder.path() / "nothing.csv"), files::BadInput);
  EXPECT_THROW(read_trucks(table("recording,truck\na.csv,T1\n")), files::BadInput);
  EXPECT_THROW(read_trucks(table("truck,bus\n,can0\n")), files::BadInput);
  EXPECT_THROW(read_trucks(table("truck,bus\nT1,\n")), files::BadInput);
  files::write_file(folder.path() / "out.csv", "something,else\n1,2\n");
  EXPECT_THROW(run(table("truck,bus\nT1,can0\n")), files::BadInput);
}

TEST_F(DepotUpdate, OneTruckOfABusIsUpdatedInARunAndTheNextOneInTheNext) {
  const auto list = table("truck,bus\nT1,can0\nT2,can1\nT3,can0\n");
  auto rows = run(list);
  EXPECT_THAT(worked_on, UnorderedElementsAre("T1", "T2"));
  EXPECT_EQ(rows[0].state, "done");
  EXPECT_EQ(rows[2].state, "waiting");
  EXPECT_THAT(out(), HasSubstr("T3,can0,waiting,,,image 1,"));
  rows = run(list);
  EXPECT_THAT(worked_on, ElementsAre("T3"));
  EXPECT_EQ(rows[2].state, "done");
  EXPECT_EQ(rows[2].runs, "0.3.0");
  run(list);
  EXPECT_THAT(worked_on, IsEmpty());
  EXPECT_THAT(out(), HasSubstr("T1,can0,done,0.3.0,,image 1,"));
}

TEST_F(DepotUpdate, CellConstantsStandNextToTheVersionUntilAnotherImageEndsThem) {
  const auto list = table("truck,bus\nT1,can0\n");
  run(list);
  kind = boot::Kind::cell;
  auto rows = run(list, "constants");
  EXPECT_EQ(rows[0].cell, "0.3.0") << "what the result says acts";
  EXPECT_EQ(rows[0].runs, "0.3.0");
  returns = "T1";
  rows = run(list, "other constants");
  EXPECT_EQ(rows[0].cell, "0.2.0") << "the old ones";
  kind = boot::Kind::application;
  returns = "";
  rows = run(list, "image 2");
  EXPECT_EQ(rows[0].cell, "");
  EXPECT_EQ(rows[0].runs, "0.3.0");
}

TEST_F(DepotUpdate, AnotherImageIsSentToAllAgain) {
  const auto list = table("truck,bus\nT1,can0\nT2,can1\n");
  run(list);
  run(list, "image 2");
  EXPECT_THAT(worked_on, UnorderedElementsAre("T1", "T2"));
}

TEST_F(DepotUpdate, WhatFailsOnOneBusDoesNotStopTheOthersAndIsTriedAgain) {
  const auto list = table("truck,bus\nT1,can0\nT2,can1\nT3,can2\n");
  broken = "T1";
  returns = "T2";
  auto rows = run(list);
  EXPECT_EQ(rows[0].state, "refused");
  EXPECT_EQ(rows[0].reason, "the adapter is gone");
  EXPECT_EQ(rows[1].state, "returned");
  EXPECT_EQ(rows[1].runs, "0.2.0") << "the old one";
  EXPECT_EQ(rows[2].state, "done");
  broken = returns = "";
  rows = run(list);
  EXPECT_THAT(worked_on, UnorderedElementsAre("T1", "T2"));
  for (const auto& row : rows) EXPECT_EQ(row.state, "done");
}

}  // namespace
}  // namespace bms::update
