#include "tests/firmware/elf_image.hpp"

#include <elf.h>

#include <algorithm>
#include <cstring>
#include <regex>
#include <sstream>
#include <stdexcept>

#include "files/text_file.hpp"
#include "images/child_process.hpp"

namespace bms::firmware {

std::vector<ProgramPart> program_of(const std::filesystem::path& image) {
  const std::string all = files::read_file(image);
  const auto read = [&](auto& into, std::size_t at) {
    if (at + sizeof into > all.size()) throw std::runtime_error(image.string() + " breaks off");
    std::memcpy(&into, all.data() + at, sizeof into);
  };
  Elf32_Ehdr head{};
  read(head, 0);
  std::vector<ProgramPart> parts;
  for (unsigned k = 0; k < head.e_phnum; ++k) {
    Elf32_Phdr part{};
    read(part, head.e_phoff + k * sizeof part);
    if (part.p_type != PT_LOAD || part.p_filesz == 0) continue;
    parts.push_back({part.p_paddr, all.substr(part.p_offset, part.p_filesz)});
  }
  return parts;
}

std::vector<Symbol> symbols_of(const std::filesystem::path& image, const std::string& tools) {
  std::vector<Symbol> symbols;
  std::istringstream lines(
      images::output_of({tools + "nm", "--demangle", "--special-syms", "--format=sysv", image.string()}));
  for (std::string line; std::getline(lines, line);) {
    std::vector<std::string> fields;  // name|value|class|type|size|line|section
    std::istringstream in(line);
    for (std::string field; std::getline(in, field, '|');) fields.push_back(field);
    if (fields.size() < 5 || fields[0].starts_with("Name")) continue;
    const auto number = [](const std::string& s) {
      return s.find_first_not_of(' ') == std::string::npos ? 0 : std::stoull(s, nullptr, 16);
    };
    const auto end = fields[0].find_last_not_of(' ');
    const auto kind = fields[2].find_first_not_of(' ');
    symbols.push_back({number(fields[1]), number(fields[4]), kind == std::string::npos ? ' ' : fields[2][kind],
                       fields[0].substr(0, end + 1)});
  }
  return symbols;
}

Symbol symbol_named(const std::vector<Symbol>& symbols, const std::string& begin) {
  const auto is_it = [&](const Symbol& s) { return s.name.starts_with(begin) && s.size > 0; };
  const auto found = std::find_if(symbols.begin(), symbols.end(), is_it);
  if (found == symbols.end()) throw std::runtime_error("no symbol " + begin);
  if (std::any_of(found + 1, symbols.end(), is_it)) throw std::runtime_error("more than one symbol " + begin);
  return *found;
}

ImageSize size_of(const std::filesystem::path& image) {
  std::istringstream out(images::output_of({"arm-none-eabi-size", image.string()}));
  std::string headings;
  std::getline(out, headings);
  ImageSize size;
  out >> size.text >> size.data >> size.bss;
  if (!out) throw std::runtime_error("no sizes of " + image.string());
  return size;
}

std::vector<std::string> forbidden_in(const std::vector<Symbol>& symbols) {
  static const std::regex forbidden(
      "__aeabi_d.*|__aeabi_[fiul]+2d|__aeabi_cd.*|__.*df[23]"                                        // double
      "|_?malloc(_r)?|_?calloc(_r)?|_?realloc(_r)?|_?free(_r)?|_?sbrk(_r)?|operator (new|delete).*"  // heap
      "|__cxa_(throw|allocate|rethrow|begin_catch).*|_Unwind_.*|__gxx_personality.*"                 // exceptions
      "|typeinfo .*|vtable .*|__dynamic_cast");  // run-time type information
  std::vector<std::string> found;
  for (const Symbol& s : symbols) {
    const std::string name = s.name.substr(0, s.name.find('@'));
    if (std::regex_match(name, forbidden)) found.push_back(name);
  }
  return found;
}

}  // namespace bms::firmware
