// DBC files as editors write them: each construct of the grammar in a small file, and what is wrong in one.
#include "files/logs/dbc.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <span>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "tests/host_sim/files/rejected_input.hpp"

namespace bms::files {
namespace {

using ::testing::HasSubstr;

constexpr const char* message = "BO_ 291 Battery: 8 Bms\n";
constexpr const char* signal = " SG_ U : 0|16@1+ (0.001,0) [0|0] \"V\" Vector__XXX\n";

/// A small file, and the value of its signal U in a frame; NaN: the frame does not have it.
struct SmallFile {
  const char* what;
  std::string text;
  std::vector<std::uint8_t> data;
  double value;
};

const double absent = std::nan("");
const std::vector<std::uint8_t> volts = {0xD8, 0x0C, 0, 0, 0, 0, 0, 0};  // 3288

std::string with(const std::string& before, const std::string& after) { return before + message + signal + after; }
std::string of(const std::string& place, const std::string& rest = "(1,0) [0|0] \"\" X") {
  return message + fmt::format(" SG_ U : {} {}\n", place, rest);
}

std::vector<SmallFile> sections() {
  const std::string mux = std::string(message) + " SG_ P M : 0|8@1+ (1,0) [0|0] \"\" X\n";
  return {
      {"the signal alone", with("", ""), volts, 3.288},
      {"VERSION", with("VERSION \"1.0\"\n", ""), volts, 3.288},
      {"VERSION without a line end", with("VERSION \"1.0\" NS_ :\n", ""), volts, 3.288},
      {"NS_ with keywords", with("NS_ :\n\tNS_DESC_\n\tCM_\n\tBA_DEF_\n\tVAL_\n\tSG_MUL_VAL_\n\nBS_:\n\n", ""), volts,
       3.288},
      {"NS_ in one line", with("NS_ : CM_ BA_ VAL_\nBS_:\n", ""), volts, 3.288},
      {"NS_ without BS_", with("NS_ :\n  CM_\n  VAL_\n", ""), volts, 3.288},
      {"NS_ with a keyword that no standard has", with("NS_ :\n  CM_\n  OWN_THING_\nBS_:\n", ""), volts, 3.288},
      {"BS_ with a speed", with("BS_: 500 : 1,2\n", ""), volts, 3.288},
      {"BU_ in two lines", with("BU_: Bms\n  Charger\n", ""), volts, 3.288},
      {"VAL_TABLE_", with("VAL_TABLE_ States 1 \"on\" 0 \"off\" ;\n", ""), volts, 3.288},
      {"BO_TX_BU_", with("", "BO_TX_BU_ 291 : Bms,Charger;\n"), volts, 3.288},
      {"EV_", with("", "EV_ Key: 0 [0|1] \"\" 0 1 DUMMY_NODE_VECTOR0 Vector__XXX;\n"), volts, 3.288},
      {"CM_ with keywords and lines", with("", "CM_ SG_ 291 U \"a\nSG_ wrong\nBO_ too; \"\" text\";\n"), volts, 3.288},
      {"CM_ with a quote inside", with("CM_ \"a 5\" hose\nSG_ too\";\n", ""), volts, 3.288},
      {"CM_ with a path", with("CM_ \"C:\\cars\\\";\n", ""), volts, 3.288},
      {"BA_DEF_, BA_DEF_DEF_, BA_",
       with("", "BA_DEF_ BO_  \"Cycle\" INT 0 9;\nBA_DEF_DEF_  \"Cycle\" 1;\nBA_ \"Cycle\" BO_ 291 7;\n"), volts,
       3.288},
      {"BA_DEF_REL_", with("", "BA_DEF_REL_ BU_SG_REL_  \"Timeout\" INT 0 9;\n"), volts, 3.288},
      {"SIG_GROUP_", with("", "SIG_GROUP_ 291 Cells 1 : U;\n"), volts, 3.288},
      {"VAL_", with("", "VAL_ 291 U 3288 \"usual\" 1 \"odd\" ;\n"), volts, 3.288},
      {"a section that nobody knows", with("MY_SECTION_ 1 2 \"SG_\" ;\n", "OTHER_ a b\n"), volts, 3.288},
      {"a section without its semicolon", with("VAL_ 1 A 0 \"off\"\n", ""), volts, 3.288},
      {"CR LF", with("VERSION \"\"\r\n\r\nNS_ :\r\n\tCM_\r\n\r\n", ""), volts, 3.288},
      {"Latin-1",
       of("0|16@1+",
          "(0.1,0) [0|0] \"\xB0"
          "C\" Bj\xF6rn"),
       volts, 328.8},
      {"SG_ of 29 bits", "BO_ 2566844926 Bms: 8 X\n" + std::string(signal), volts, 3.288},
      {"several receivers", of("0|16@1+", "(0.001,0) [0|0] \"V\"  A,B, C"), volts, 3.288},
      {"receivers in two lines", of("0|16@1+", "(0.001,0) [0|0] \"V\" A,\n  B"), volts, 3.288},
      {"M and m", mux + " SG_ U m2 : 8|8@1+ (1,0) [0|0] \"\" X\n", {2, 7}, 7},
      {"M of another value", mux + " SG_ U m2 : 8|8@1+ (1,0) [0|0] \"\" X\n", {3, 7}, absent},
      {"M behind its signals",
       std::string(message) + " SG_ U m2 : 8|8@1+ (1,0) [0|0] \"\" X\n"
                              " SG_ P M : 0|8@1+ (1,0) [0|0] \"\" X\n",
       {2, 7},
       7},
      {"VECTOR__INDEPENDENT_SIG_MSG",
       with("", "BO_ 3221225472 VECTOR__INDEPENDENT_SIG_MSG: 0 X\n SG_ U : 0|8@1+ (1,0) [0|0] \"\" X\n"), volts, 3.288},
  };
}

std::vector<SmallFile> values() {
  const std::string nested = std::string(message) +
                             " SG_ P M : 0|8@1+ (1,0) [0|0] \"\" X\n SG_ Q m1M : 8|8@1+ (1,0) [0|0] \"\" X\n"
                             " SG_ U m0 : 16|8@1+ (1,0) [0|0] \"\" X\nSG_MUL_VAL_ 291 Q P 1-1;\n"
                             "SG_MUL_VAL_ 291 U Q 3-5, 9 - 9;\n";
  return {
      {"SG_MUL_VAL_", nested, {1, 4, 7}, 7},
      {"SG_MUL_VAL_, second range", nested, {1, 9, 7}, 7},
      {"SG_MUL_VAL_, between the ranges", nested, {1, 8, 7}, absent},
      {"SG_MUL_VAL_, other page", nested, {0, 4, 7}, absent},
      {"little endian across bytes", of("4|12@1+"), {0x50, 0x12}, 0x125},
      {"big endian across bytes", of("3|12@0+"), {0x01, 0x25}, 0x125},
      {"big endian, signed", of("7|16@0-", "(0.1,0) [0|0] \"\" X"), {0xFF, 0xF0}, -1.6},
      {"signed", of("0|12@1-"), {0xFF, 0x0F}, -1},
      {"64 bits, to the last digit",
       of("0|64@1+", "(0.1,0) [0|0] \"\" X"),
       {0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x7F},
       922337203685477580.7},
      {"factor with an exponent", of("0|8@1+", "(1E-003,+2.5e1) [0|0] \"\" X"), {3}, 25.003},
      {"spaces everywhere", of("0 | 8 @ 1 +", "( 2 , 1 ) [ 0 | 0 ] \"\""), {3}, 7},
      {"a range that is not a number", of("0|8@1+", "(1,0) [-1.#INF|x] \"\" X"), {3}, 3},
      {"SIG_VALTYPE_ 1", of("0|32@1-") + "SIG_VALTYPE_ 291 U : 1;\n", {0, 0, 0xC0, 0x3F}, 1.5},
      {"SIG_VALTYPE_ 2 without ':'", of("7|64@0-") + "SIG_VALTYPE_ 291 U 2;\n", {0x3F, 0xF8, 0, 0, 0, 0, 0, 0}, 1.5},
      {"CAN FD, the last byte", of("504|8@1+"), std::vector<std::uint8_t>(64, 9), 9},
      {"a frame that is too short", of("8|8@1+"), {1}, absent},
  };
}

TEST(DbcFile, IsReadByEveryConstructOfItsGrammar) {
  std::vector<SmallFile> files = sections();
  for (SmallFile& file : values()) files.push_back(std::move(file));
  EXPECT_GE(files.size(), 40U);
  for (const SmallFile& file : files) {
    SCOPED_TRACE(file.what);
    std::vector<DbcSignal> all;
    try {
      all = parse_dbc(file.text, "small.dbc");
    } catch (const BadInput& error) {
      ADD_FAILURE() << error.what();
      continue;
    }
    std::vector<DbcSignal> found;
    for (const DbcSignal& s : all) {
      if (s.name == "U") found.push_back(s);
    }
    ASSERT_EQ(found.size(), 1U);
    const bool sent = is_sent(found[0], multiplexors_of(found[0], all, "small.dbc"), file.data);
    EXPECT_EQ(sent, !std::isnan(file.value));
    if (sent) {
      EXPECT_EQ(value_of(found[0], file.data), file.value);
    }
  }
}

/// Each with its line, counted by hand.
TEST(DbcFile, WithAFaultIsRefusedWithItsLine) {
  const struct {
    const char *text, *said;
  } files[] = {
      {"", ":1: no signal"},
      {"BO_ 291 Battery: 8 X\n", ":1: no signal"},
      {"some prose\nthat is not a DBC file\n", ":1: no signal"},
      {"BO_ x Battery: 8 X\n",
       ":1: 'BO_ x Battery: 8 X' is not a line of a DBC file, expected the number of a message"},
      {"\n\nBO_ 291 Battery 8 X\n", ":3: 'BO_ 291 Battery 8 X' is not a line of a DBC file, expected ':'"},
      {"SG_ U : 0|8@1+ (1,0) [0|0] \"\" X\n", "expected BO_ with its message above"},
      {"BO_ 1 B: 8 X\n SG_ U 0|8@1+ (1,0) [0|0] \"\" X\n", ":2: 'SG_ U 0|8@1+ (1,0) [0|0] \"\" X'"},
      {"BO_ 1 B: 8 X\n SG_ U q2 : 0|8@1+ (1,0) [0|0] \"\" X\n", "expected ':', M, m1 or m1M"},
      {"BO_ 1 B: 8 X\n SG_ U : 0|65@1+ (1,0) [0|0] \"\" X\n", "expected 1 to 64 bits"},
      {"BO_ 1 B: 8 X\n SG_ U : 0|8@2+ (1,0) [0|0] \"\" X\n", "expected 0 or 1 and '+' or '-'"},
      {"BO_ 1 B: 8 X\n SG_ U : 0|8@1+ (1) [0|0] \"\" X\n", "expected '(factor,offset)', two numbers"},
      {"BO_ 1 B: 8 X\n SG_ U : 0|8@1+ (1,0) \"\" X\n", "expected '[lowest|highest]'"},
      {"BO_ 1 B: 8 X\n SG_ U : 0|8@1+ (1,0) [0|0] \"V X\n", "expected the unit in quotes"},
      {"BO_ 1 B: 8 X\n SG_ U : 0|8@1+ (1,0) [0|0] \"\" X\nCM_ \"open\n\n", ":3: 'CM_ \"open' is not a line"},
      {"BO_ 1 B: 8 X\n SG_ U : 0|8@1+ (1,0) [0|0] \"\" X\nSIG_VALTYPE_ 1 U : 1;\n", ":3: 'SIG_VALTYPE_ 1 U : 1;'"},
      {"BO_ 1 B: 8 X\n SG_ U : 0|8@1+ (1,0) [0|0] \"\" X\nSG_MUL_VAL_ 1 U P one;\n", "expected a message, a signal"},
  };
  for (const auto& [text, said] : files)
    EXPECT_THAT(refusal_by("bad.dbc", [&] { parse_dbc(text, "bad.dbc"); }), HasSubstr(said)) << text;
}

TEST(DbcSignalOfAMultiplexor, ThatIsMissingOrSelectsItselfIsRefusedWhereItIsUsed) {
  const auto refused = [](const std::string& signals) {
    const std::vector<DbcSignal> all = parse_dbc(message + signals, "mux.dbc");
    return refusal_by("mux.dbc", [&] { multiplexors_of(all[0], all, "mux.dbc"); });
  };
  const std::string u = " SG_ U m1 : 8|8@1+ (1,0) [0|0] \"\" X\n", p = " SG_ P m1M : 0|8@1+ (1,0) [0|0] \"\" X\n";
  EXPECT_THAT(refused(u), HasSubstr(":2: 'U' is sent with some values of 'M' only"));
  EXPECT_THAT(refused(u + p + "SG_MUL_VAL_ 291 U P 1-1;\nSG_MUL_VAL_ 291 P U 1-1;\n"), HasSubstr("select each other"));
}

TEST(DbcSignal, HasTheLongNameOfItsEditorAndTheShortOne) {
  const auto all = parse_dbc(with("",
                                  "BA_ \"SystemSignalLongSymbol\" SG_ 291 U \"VoltageOfTheFirstCell\";\n"
                                  "BA_ \"SystemMessageLongSymbol\" BO_ 291 \"TheBattery\";\n"),
                             "long.dbc");
  EXPECT_EQ(all[0].name, "VoltageOfTheFirstCell");
  EXPECT_EQ(all[0].short_name, "U");
  EXPECT_EQ(all[0].message, "TheBattery");
}

TEST(DbcSignal, WhoseValueTableSaysNotAvailableIsMissing) {
  const auto all = parse_dbc(with("", "VAL_ 291 U 3288 \"Not available\" 3289 \"usual\" ;\n"), "texts.dbc");
  EXPECT_TRUE(is_missing(all[0], volts));
  EXPECT_FALSE(is_missing(all[0], std::vector<std::uint8_t>{0xD9, 0x0C}));
}

/// J1939: the id in the file has the source address 254, the frames that of the battery, and any priority.
TEST(DbcMessageOfJ1939, IsSentByAnySourceIfTheFileNamesNone) {
  const std::string formats =
      "BA_DEF_ BO_  \"VFrameFormat\" ENUM  \"StandardCAN\",\"ExtendedCAN\",\"reserved\",\"J1939PG\";\n"
      "BA_DEF_DEF_  \"VFrameFormat\" \"J1939PG\";\n";
  const auto file = [&](std::uint32_t id, const std::string& rest) {
    return parse_dbc(fmt::format("BO_ {} B: 8 X\n", id | 0x8000'0000U) + signal + rest, "j1939.dbc")[0];
  };
  const DbcSignal s = file(0x18FF'50FE, formats);
  EXPECT_TRUE(is_of(s, 0x18FF'50F3, true));
  EXPECT_TRUE(is_of(s, 0x0CFF'50F4, true)) << "another priority";
  EXPECT_FALSE(is_of(s, 0x18FF'51F3, true)) << "another group";
  EXPECT_FALSE(is_of(file(0x18FF'50FE, ""), 0x18FF'50F3, true)) << "not J1939";
  EXPECT_FALSE(is_of(file(0x18FF'50F4, formats), 0x18FF'50F3, true)) << "the file names the source";
  EXPECT_TRUE(is_of(file(0x18EA'FFFE, formats), 0x18EA'01F3, true)) << "the receiver is not a part of the group";
}

}  // namespace
}  // namespace bms::files
