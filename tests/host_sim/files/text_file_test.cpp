// Files that are written or not at all, and what is not a file.
#include "files/text_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>

#include "files/temporary_folder.hpp"
#include "tests/host_sim/files/rejected_input.hpp"

namespace bms::files {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

class TextFile : public ::testing::Test {
 protected:
  fs::path path(const char* name) const { return folder_.path() / name; }
  std::size_t files() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_.path()), fs::directory_iterator{}));
  }
  files::TemporaryFolder folder_;
};

TEST(TemporaryFolder, IsNewAndGoesWithItsContent) {
  fs::path gone;
  {
    const TemporaryFolder one, other;
    gone = one.path();
    EXPECT_NE(one.path(), other.path());
    fs::create_directory(gone / "inner");
    write_file(gone / "inner" / "file", "x");
  }
  EXPECT_FALSE(fs::exists(gone));
}

/// The temporary file's name must not be one that another user can prepare.
TEST_F(TextFile, ALinkInPlaceOfTheTemporaryFileIsNotFollowed) {
  write_file(path("victim"), "precious");
  const fs::path expected = path("out").string() + "." + std::to_string(getpid()) + ".tmp";
  fs::create_symlink(path("victim"), expected);
  write_file(path("out"), "result");
  EXPECT_EQ(read_file(path("victim")), "precious");
  EXPECT_EQ(read_file(path("out")), "result");
  EXPECT_FALSE(fs::is_symlink(path("out")));
}

TEST_F(TextFile, AReplacedFileKeepsItsPermissionsAndALinkItsTarget) {
  write_file(path("private"), "old");
  fs::permissions(path("private"), fs::perms(0600));
  fs::create_symlink("private", path("link"));
  write_file(path("link"), "new");
  EXPECT_TRUE(fs::is_symlink(path("link")));
  EXPECT_EQ(read_file(path("private")), "new");
  EXPECT_EQ(fs::status(path("private")).permissions(), fs::perms(0600));
  EXPECT_EQ(files(), 2U);
}

TEST_F(TextFile, ANewFileHasThePermissionsOfTheUmask) {
  const mode_t before = umask(027);
  write_file(path("new"), "x");
  umask(before);
  EXPECT_EQ(fs::status(path("new")).permissions(), fs::perms(0640));
}

TEST_F(TextFile, WhatCannotBeWrittenIsNamedAndLeavesNothing) {
  fs::create_symlink("b", path("a"));
  fs::create_symlink("a", path("b"));
  for (const fs::path& wanted : {path("a"), path("none/x"), folder_.path()}) {
    const std::string line = refusal_by(wanted.string(), [&] { write_file(wanted, "x"); });
    EXPECT_THAT(line, HasSubstr("cannot be written")) << wanted;
  }
  EXPECT_EQ(files(), 2U);
}

/// Opening a pipe without a writer would wait for ever.
TEST_F(TextFile, APipeOrADeviceIsRejectedWithoutOpeningIt) {
  ASSERT_EQ(mkfifo(path("pipe").c_str(), 0600), 0);
  for (const fs::path& wanted : {path("pipe"), fs::path("/dev/zero")}) {
    const std::string line = refusal_by(wanted.string(), [&] { read_file(wanted); });
    EXPECT_THAT(line, HasSubstr("a pipe or a device, expected a regular file"));
  }
}

TEST_F(TextFile, ALargerFileThanTheLimitIsRejected) {
  std::ofstream(path("large")) << "x";
  fs::resize_file(path("large"), largest_file_bytes + 1);  // sparse: takes no place
  EXPECT_THAT(refusal_by(path("large").string(), [&] { read_file(path("large")); }), HasSubstr("expected at most"));
}

/// FIPS 180-2, appendix B.1.
TEST(Sha256, OfAbcIsTheStandardsExample) {
  EXPECT_EQ(sha256("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256_base64("abc"), "ungWv48Bz+pBQUDeXa4iI7ADYaOWF3qctBD/YfIAFa0=");
}

TEST(Printable, NothingThatATerminalObeysIsLeft) {
  EXPECT_EQ(printable("a\x1b]0;own\x07.csv"), "a?]0;own?.csv");
  EXPECT_EQ(printable("one\ntwo"), "one?two");
  EXPECT_EQ(printable("one\ntwo", true), "one\ntwo");
  EXPECT_EQ(printable("25 \xC2\xB0"
                      "C"),
            "25 \xC2\xB0"
            "C");
  EXPECT_EQ(printable("\xC2\x9B"
                      "31m"),
            "?31m")
      << "U+009B is a control sequence introducer";
}

}  // namespace
}  // namespace bms::files
