#include "files/logs/text_lines.hpp"

#include <archive.h>
#include <archive_entry.h>

#include <array>
#include <cstring>
#include <filesystem>
#include <utility>

#include <fmt/format.h>

#include "files/bad_input.hpp"

namespace bms::files {

namespace {

constexpr std::size_t piece_bytes = 1U << 20;
constexpr std::size_t expected_ratio = 5;  ///< of a compressed log, for a first guess of its rows

struct BinaryFormat {
  std::string_view begin;
  const char* what;
};
/// Formats that are not text, by their first bytes, and how to get a text from them.
constexpr std::array binary_formats = {
    BinaryFormat{"PK\x03\x04", "a ZIP archive or an Excel workbook, expected text: unpack it, or save it as CSV"},
    BinaryFormat{"\xD0\xCF\x11\xE0", "an old Excel workbook (.xls), expected text: save it as CSV"},
    BinaryFormat{"MDF     ",
                 "an MDF4 measurement (.mf4), expected text: convert it with asammdf, "
                 "python3 -c \"import sys, asammdf; asammdf.MDF(sys.argv[1]).export('csv', "
                 "single_time_base=True)\" FILE.mf4"},
    BinaryFormat{"LOGG",
                 "a Vector BLF log, expected text: convert it with python-can, "
                 "python3 -m can.logconvert FILE.blf FILE.asc"},
    BinaryFormat{"PAR1",
                 "a Parquet table, expected text: python3 -c \"import sys, pandas; "
                 "pandas.read_parquet(sys.argv[1]).to_csv('log.csv', index=False)\" FILE.parquet"},
    BinaryFormat{"\x89HDF", "an HDF5 or MATLAB 7.3 file, expected text: export it as CSV"},
    BinaryFormat{"MATLAB 5.0", "a MATLAB file, expected text: export the table with writetable(T, 'log.csv')"},
    BinaryFormat{"BIO-LOGIC MODULAR FILE", "a binary BioLogic file (.mpr), expected text: export it as text (.mpt)"},
    BinaryFormat{"NEWARE", "a binary Neware file (.nda), expected text: export it as CSV from BTSDA"},
    BinaryFormat{std::string_view("\0\1\0\0Standard", 12),
                 "an Access database (Arbin .res), expected text: export it as CSV from MITS Pro or Data Watcher"},
    BinaryFormat{"SQLite format 3", "an SQLite database, expected text: export the table as CSV"},
};

void append_utf8(std::string& out, unsigned code) {
  if (code < 0x80) {
    out += static_cast<char>(code);
  } else if (code < 0x800) {
    out += static_cast<char>(0xC0 | (code >> 6));
    out += static_cast<char>(0x80 | (code & 0x3F));
  } else if (code < 0x10000) {
    out += static_cast<char>(0xE0 | (code >> 12));
    out += static_cast<char>(0x80 | ((code >> 6) & 0x3F));
    out += static_cast<char>(0x80 | (code & 0x3F));
  } else {
    out += static_cast<char>(0xF0 | (code >> 18));
    out += static_cast<char>(0x80 | ((code >> 12) & 0x3F));
    out += static_cast<char>(0x80 | ((code >> 6) & 0x3F));
    out += static_cast<char>(0x80 | (code & 0x3F));
  }
}

}  // namespace

/// Bytes of the file, decompressed; or a text in memory.
struct TextLines::Source {
  std::string path;
  std::string_view memory;
  archive* from = nullptr;
  std::string piece = std::string(piece_bytes, '\0');

  ~Source() {
    if (from != nullptr) archive_read_free(from);
  }
  void open() {
    from = archive_read_new();
    archive_read_support_filter_gzip(from);
    archive_read_support_filter_zstd(from);
    archive_read_support_filter_xz(from);
    archive_read_support_filter_bzip2(from);
    archive_read_support_format_raw(from);
    archive_read_support_format_empty(from);
    archive_entry* entry = nullptr;
    if (archive_read_open_filename(from, path.c_str(), piece_bytes) != ARCHIVE_OK ||
        archive_read_next_header(from, &entry) < ARCHIVE_WARN) {
      if (archive_errno(from) == 0) return;  // an empty file
      refuse();
    }
  }
  [[noreturn]] void refuse() const {
    const char* why = archive_error_string(from);
    throw BadInput(path, 1, fmt::format("cannot be read ({}), expected a file", why == nullptr ? "damaged" : why));
  }
  std::string_view read() {
    if (from == nullptr) return std::exchange(memory, {});
    const la_ssize_t n = archive_read_data(from, piece.data(), piece.size());
    if (n < 0) refuse();
    return {piece.data(), static_cast<std::size_t>(n)};
  }
};

TextLines::TextLines(const std::string& path) : path_(path), source_(std::make_unique<Source>()) {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (fs::is_directory(status)) throw BadInput(path, 1, "a folder, expected a file");
  if (fs::exists(status) && !fs::is_regular_file(status))
    throw BadInput(path, 1, "a pipe or a device, expected a regular file");
  const auto size = fs::file_size(path, error);
  if (error) throw BadInput(path, 1, "cannot be read (" + error.message() + "), expected a file");
  source_->path = path;
  expected_bytes_ = size;
  if (size > 0) {
    source_->open();
    if (archive_filter_count(source_->from) > 1) {
      encoding_ = archive_filter_name(source_->from, 0);
      expected_bytes_ = size * expected_ratio;
    }
  }
  begin();
}

TextLines::TextLines(std::string_view text, const std::string& path)
    : path_(path), source_(std::make_unique<Source>()), expected_bytes_(text.size()) {
  source_->memory = text;
  begin();
}

TextLines::~TextLines() = default;

/// Looks at the first piece: binary formats, byte order mark, line end.
void TextLines::begin() {
  const std::string_view first = source_->read();
  std::string_view text = first;
  for (const BinaryFormat& format : binary_formats) {
    if (text.starts_with(format.begin)) throw BadInput(path_, 1, format.what);
  }
  const auto note = [&](const char* name) { encoding_ += (encoding_.empty() ? "" : ", ") + std::string(name); };
  if (text.starts_with("\xEF\xBB\xBF")) {
    text.remove_prefix(3);
  } else if (text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF")) {
    code_ = text[0] == '\xFF' ? Code::utf16_low_first : Code::utf16_high_first;
    note("UTF-16");
    text.remove_prefix(2);
  }
  if (first.empty()) ended_ = true;
  if (code_ == Code::utf8)
    buffer_ = text;
  else
    decode_utf16(text);
  bytes_ = first.size();
  const std::size_t feed = buffer_.find('\n'), end = buffer_.find('\r');
  if (feed == std::string::npos && end != std::string::npos && end + 1 < buffer_.size()) line_end_ = '\r';
}

void TextLines::decode_utf16(std::string_view bytes) {
  half_ += bytes;
  std::size_t k = 0;
  for (; k + 1 < half_.size(); k += 2) {
    const auto a = static_cast<unsigned char>(half_[k]), b = static_cast<unsigned char>(half_[k + 1]);
    const unsigned unit = code_ == Code::utf16_low_first ? a + 256U * b : b + 256U * a;
    if (unit >= 0xD800 && unit < 0xDC00) {
      high_surrogate_ = unit;
    } else if (unit >= 0xDC00 && unit < 0xE000) {
      append_utf8(buffer_, 0x10000 + ((high_surrogate_ & 0x3FF) << 10) + (unit & 0x3FF));
    } else {
      append_utf8(buffer_, unit);
    }
  }
  half_.erase(0, k);
}

/// Appends a piece to the buffer; what was returned is dropped. Returns false at the end of the file.
bool TextLines::fill() {
  buffer_.erase(0, at_);
  at_ = 0;
  const std::string_view piece = source_->read();
  if (piece.empty()) {
    ended_ = true;
    return false;
  }
  bytes_ += piece.size();
  if (code_ == Code::utf8)
    buffer_ += piece;
  else
    decode_utf16(piece);
  return true;
}

bool TextLines::next(std::string_view& line) {
  std::size_t searched = 0;
  for (;;) {
    const char* const from = buffer_.data() + at_;
    const std::size_t left = buffer_.size() - at_;
    const void* const found = left > searched ? std::memchr(from + searched, line_end_, left - searched) : nullptr;
    if (found == nullptr && !ended_) {
      searched = left;
      fill();
      continue;
    }
    if (found == nullptr && left == 0) return false;
    cut_ = found == nullptr;
    const std::size_t length = cut_ ? left : static_cast<std::size_t>(static_cast<const char*>(found) - from);
    line = {from, length};
    at_ += length + (cut_ ? 0 : 1);
    ++number_;
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    if (line.find('\0') != std::string_view::npos)
      throw BadInput(path_, number_, "not a text file, expected a recording in CSV");
    return true;
  }
}

}  // namespace bms::files
