#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <string>

#include "monitor/candump_line.hpp"
#include "monitor/frame_source.hpp"
#include "tests/host_sim/monitor/traffic.hpp"
#include "tests/pseudo_terminal.hpp"

namespace bms::monitor {
namespace {

using ::testing::HasSubstr;

std::string dump_of(int samples) {
  Traffic traffic;
  std::string text;
  for (int k = 0; k < samples; ++k) {
    for (const BusFrame& frame : traffic.sample()) append_dump_line(text, frame, "can0");
  }
  return text;
}

class Dump : public ::testing::Test {
 protected:
  Dump() {
    char name[] = "/tmp/bms_dump.XXXXXX";
    close(mkstemp(name));
    path_ = name;
  }
  ~Dump() override { unlink(path_.c_str()); }

  void write(const std::string& content) const { std::ofstream(path_, std::ios::binary) << content; }
  void compress(const std::string& content) const {
    write(content);
    ASSERT_EQ(std::system(("gzip -c " + path_ + " > " + path_ + ".gz && mv " + path_ + ".gz " + path_).c_str()), 0);
  }

  struct Read {
    std::uint64_t frames = 0, malformed = 0, check = 0;
  };
  Read read(std::size_t room = 256) const {
    Read r;
    const auto source = open_source("file:" + path_);
    std::vector<BusFrame> frames(room);
    while (!source->ended()) {
      const std::size_t n = source->read(frames, 100);
      for (std::size_t k = 0; k < n; ++k)
        r.check = r.check * 31 + frames[k].id + frames[k].data[0] + static_cast<std::uint64_t>(frames[k].time_us);
      r.frames += n;
    }
    r.malformed = source->malformed();
    return r;
  }
  std::string rejection() const {
    try {
      read();
    } catch (const SourceError& rejected) {
      return rejected.what();
    }
    return "";
  }

  std::string path_;
};

TEST_F(Dump, IsReadCompletelyWithAnyBufferSize) {
  write(dump_of(1'000));
  const Read all = read();
  EXPECT_EQ(all.frames, 8'000U);
  EXPECT_EQ(all.malformed, 0U);
  EXPECT_EQ(read(1).check, all.check);
  EXPECT_EQ(read(7).check, all.check);
}

TEST_F(Dump, CompressedByGzipIsReadTheSameAlsoInSeveralMembers) {
  const std::string text = dump_of(1'000);
  write(text + text);
  const Read plain = read();
  compress(text + text);
  EXPECT_EQ(read().check, plain.check);
  compress(text);
  std::ifstream in(path_, std::ios::binary);
  const std::string piece{std::istreambuf_iterator<char>(in), {}};
  write(piece + piece);
  EXPECT_EQ(read().check, plain.check);
  EXPECT_EQ(read().frames, 16'000U);
}

TEST_F(Dump, TruncatedIsReadUpToTheTruncation) {
  const std::string text = dump_of(1'000);
  write(text.substr(0, text.size() - 4));
  EXPECT_EQ(read().frames, 7'999U);
  EXPECT_EQ(read().malformed, 1U);
  write(text.substr(0, text.size() - 1));
  EXPECT_EQ(read().frames, 8'000U) << "the end of the last line may be missing";
  compress(text);
  std::ifstream in(path_, std::ios::binary);
  const std::string compressed{std::istreambuf_iterator<char>(in), {}};
  write(compressed.substr(0, compressed.size() / 2));
  EXPECT_GT(read().frames, 100U);
  EXPECT_GE(read().malformed, 1U);
}

TEST_F(Dump, WithoutAFrameIsRejected) {
  write("");
  EXPECT_THAT(rejection(), HasSubstr("no frame in 0 lines"));
  write("time_s,current_a,voltage_v\n0,1,3.3\n");
  EXPECT_THAT(rejection(), HasSubstr("no frame in 2 lines"));
  write("\x1f\x8b not a gzip file");
  EXPECT_THAT(rejection(), HasSubstr("no frame"));
  write(std::string("\x1f", 1));
  EXPECT_THAT(rejection(), HasSubstr("no frame"));
}

/// /dev/zero never ends, and a gzip file of three megabytes can hold gigabytes of zeros.
TEST_F(Dump, EndlessBytesWithoutALineAreRejected) {
  const auto source = open_source("file:/dev/zero");
  std::vector<BusFrame> frames(256);
  const auto read_on = [&] {
    for (int k = 0; k < 20'000 && !source->ended(); ++k) source->read(frames, 0);
  };
  EXPECT_THROW(read_on(), SourceError);
}

TEST(Source, ThatDoesNotExistIsRejected) {
  for (const char* name :
       {"", "nonesuch0", "can 0", "slcan:/nonesuch", "slcan:/dev/null", "file:/nonesuch", "file:/tmp", "usb:0",
        "../can0", "lo", "a_name_that_no_interface_can_have", "slcan:/dev/null,rate=300",
        "file:/dev/zero,base=", "file:/dev/zero,base=0x800", "file:/dev/zero,base=0x7F0", "file:/dev/zero,base=0",
        "file:/dev/zero,stop=1F", "file:/dev/zero,rate=250", "file:/dev/zero,node=3"}) {
    EXPECT_THROW(open_source(name), SourceError) << name;
  }
}

constexpr int patience_ms = 120'000;  // a limit for a failure, not for a slow machine

/// The adapter at the other end of a serial line.
class Adapter {
 public:
  Adapter() { tests::open_pseudo_terminal(fd_, other_, name_, nullptr); }
  ~Adapter() {
    close(fd_);
    close(other_);
  }
  /// The bytes that arrive, at least `least`.
  std::string received(std::size_t least) const {
    std::string text;
    pollfd p{fd_, POLLIN, 0};
    char bytes[256];
    while (text.size() < least && poll(&p, 1, patience_ms) > 0) {
      const ssize_t n = ::read(fd_, bytes, sizeof bytes);
      if (n <= 0) break;
      text.append(bytes, static_cast<std::size_t>(n));
    }
    return text;
  }
  void send(const std::string& text) const {
    ASSERT_EQ(::write(fd_, text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  void unplug() {
    close(other_);
    close(fd_);
    fd_ = other_ = -1;
  }
  std::string source() const { return std::string("slcan:") + name_; }

 private:
  int fd_ = -1, other_ = -1;
  char name_[64] = {};
};

class Slcan : public ::testing::Test {
 protected:
  Adapter adapter;
};

TEST_F(Slcan, OpensTheChannelReadsFramesAndClosesIt) {
  {
    const auto source = open_source(adapter.source());
    EXPECT_EQ(adapter.received(8), "\rC\rS6\rO\r") << "the line is raw: no byte is changed";
    adapter.send("\r\r\rt1822AABB\rt18");
    std::vector<BusFrame> frames(8);
    const auto before_us = clock_us();
    ASSERT_EQ(source->read(frames, patience_ms), 1U);
    EXPECT_EQ(frames[0].id, 0x182U);
    EXPECT_GE(frames[0].time_us, before_us);
    EXPECT_LE(frames[0].time_us, clock_us());
    adapter.send("31CC\r\x03\x1a\rt7FF0\r");  // Ctrl-C and Ctrl-Z are ordinary bytes
    std::size_t n = 0;
    for (int tries = 0; tries < 5 && n < 2; ++tries) n += source->read(std::span(frames).subspan(n), patience_ms);
    ASSERT_EQ(n, 2U);
    EXPECT_EQ(frames[0].id, 0x183U);
    EXPECT_EQ(frames[1].id, 0x7FFU);
    EXPECT_EQ(source->malformed(), 1U);
    EXPECT_FALSE(source->ended());
  }
  EXPECT_EQ(adapter.received(2), "C\r");
}

TEST_F(Slcan, ReadsAndSendsMessagesThatHaveOtherIdentifiersOnTheBus) {
  const auto source = open_source(adapter.source() + ",rate=250,base=0x400,stop=80");
  EXPECT_EQ(adapter.received(8), "\rC\rS5\rO\r");
  adapter.send("t4022AABB\rt1822CCDD\rt0501EE\rt0A01FF\rT000001821AA\rt7FF0\r");
  std::vector<BusFrame> frames(8);
  std::size_t n = 0;
  for (int tries = 0; tries < 5 && n < 4; ++tries) n += source->read(std::span(frames).subspan(n), patience_ms);
  ASSERT_EQ(n, 4U) << "0x182 and 0x0A0 are of another node";
  EXPECT_EQ(frames[0].id, 0x182U);
  EXPECT_EQ(frames[0].data[0], 0xAA);
  EXPECT_EQ(frames[1].id, 0x0A0U);
  EXPECT_EQ(frames[1].data[0], 0xEE);
  EXPECT_EQ(frames[2].id, 0x182U) << "with 29 bits, as it is";
  EXPECT_EQ(frames[2].kind, FrameKind::extended);
  EXPECT_EQ(frames[3].id, 0x7FFU);
  EXPECT_TRUE(source->send({0x1B0, 1, {0x12}}));
  EXPECT_TRUE(source->send({0x0A0, 1, {0x34}}));
  EXPECT_EQ(adapter.received(16), "t430112\rt050134\r");
}

TEST_F(Slcan, EndsWhenTheAdapterIsUnplugged) {
  const auto source = open_source(adapter.source());
  adapter.unplug();
  std::vector<BusFrame> frames(8);
  EXPECT_EQ(source->read(frames, patience_ms), 0U);
  EXPECT_TRUE(source->ended());
}

}  // namespace
}  // namespace bms::monitor
