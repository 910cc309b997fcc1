// The lines of a text file as UTF-8, read piece by piece: plain or compressed (gzip, zstd, xz, bzip2), UTF-8 or UTF-16
// with a byte order mark, line ends of any system. A file of any size needs one buffer.
#pragma once

#include <memory>
#include <string>
#include <string_view>

namespace bms::files {

class TextLines {
 public:
  /// Throws BadInput if the file cannot be read, or if it begins like a binary format; the message names how that
  /// format is converted.
  explicit TextLines(const std::string& path);
  /// Lines of a text in memory, which must outlive this object; `path` is for messages only.
  TextLines(std::string_view text, const std::string& path);
  ~TextLines();
  TextLines(const TextLines&) = delete;
  TextLines& operator=(const TextLines&) = delete;

  /// The next line without its end; valid until the next call. Returns false at the end. Throws BadInput for a NUL and
  /// for a damaged archive.
  bool next(std::string_view& line);
  /// Number of the line that next() returned, from 1.
  std::size_t number() const { return number_; }
  /// Returns true if the line that next() returned was the last one and had no line end.
  bool cut() const { return cut_; }
  /// What is not plain UTF-8: "gzip, UTF-16"; empty otherwise.
  const std::string& encoding() const { return encoding_; }
  /// Bytes of text that were read so far.
  std::size_t bytes() const { return bytes_; }
  /// Size of the file in bytes; of a compressed file an estimate of its text.
  std::size_t expected_bytes() const { return expected_bytes_; }

 private:
  struct Source;
  bool fill();
  void begin();
  void decode_utf16(std::string_view bytes);

  std::string path_, encoding_;
  std::unique_ptr<Source> source_;
  std::string buffer_;
  std::size_t at_ = 0, number_ = 0, bytes_ = 0, expected_bytes_ = 0;
  bool ended_ = false, cut_ = false, skip_line_feed_ = false;
  char line_end_ = '\n';
  enum class Code { utf8, utf16_low_first, utf16_high_first } code_ = Code::utf8;
  std::string half_;             ///< of a UTF-16 unit, between two pieces
  unsigned high_surrogate_ = 0;  ///< waits for its low surrogate
};

}  // namespace bms::files
