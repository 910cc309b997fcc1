#include "images/image_file.hpp"

#include <elf.h>

#include <algorithm>
#include <cstring>
#include <stdexcept>

#include "files/text_file.hpp"

namespace bms::images {

namespace {

class Bytes {
 public:
  Bytes(const std::string& bytes, const std::string& path) : bytes_(bytes), path_(path) {}

  template <class T>
  T at(std::size_t offset) const {
    T value;
    std::memcpy(&value, part(offset, sizeof value).data(), sizeof value);
    return value;
  }
  std::string part(std::size_t offset, std::size_t size) const {
    if (offset > bytes_.size() || size > bytes_.size() - offset)
      throw std::runtime_error(path_ + " ends too early for an image");
    return bytes_.substr(offset, size);
  }

 private:
  const std::string& bytes_;
  const std::string& path_;
};

std::string name_in(const std::string& names, std::uint32_t offset) {
  return offset < names.size() ? names.c_str() + offset : "";
}

}  // namespace

ImageFile::ImageFile(const std::filesystem::path& path) : path_(path.string()) {
  const std::string text = files::read_file(path);
  const Bytes file(text, path_);
  const auto header = file.at<Elf32_Ehdr>(0);
  if (std::memcmp(header.e_ident, ELFMAG, SELFMAG) != 0 || header.e_ident[EI_CLASS] != ELFCLASS32 ||
      header.e_ident[EI_DATA] != ELFDATA2LSB) {
    throw std::runtime_error(path_ + " is not an ELF image of a 32-bit little-endian controller");
  }
  for (std::size_t k = 0; k < header.e_phnum; ++k) {
    const auto p = file.at<Elf32_Phdr>(header.e_phoff + k * sizeof(Elf32_Phdr));
    if (p.p_type == PT_LOAD && p.p_filesz > 0) parts_.push_back({p.p_paddr, file.part(p.p_offset, p.p_filesz)});
  }
  std::sort(parts_.begin(), parts_.end(),
            [](const LoadedPart& a, const LoadedPart& b) { return a.address < b.address; });
  std::vector<Elf32_Shdr> headers;
  for (std::size_t k = 0; k < header.e_shnum; ++k)
    headers.push_back(file.at<Elf32_Shdr>(header.e_shoff + k * sizeof(Elf32_Shdr)));
  const auto content = [&](const Elf32_Shdr& s) {
    return s.sh_type == SHT_NOBITS ? std::string() : file.part(s.sh_offset, s.sh_size);
  };
  if (header.e_shstrndx >= headers.size()) return;  // without sections
  const std::string names = content(headers[header.e_shstrndx]);
  for (const Elf32_Shdr& s : headers) {
    sections_[name_in(names, s.sh_name)] = content(s);
    if (s.sh_type != SHT_SYMTAB || s.sh_link >= headers.size()) continue;
    const std::string symbol_names = content(headers[s.sh_link]);
    for (std::size_t at = 0; at + sizeof(Elf32_Sym) <= s.sh_size; at += sizeof(Elf32_Sym)) {
      const auto symbol = file.at<Elf32_Sym>(s.sh_offset + at);
      symbols_[name_in(symbol_names, symbol.st_name)] = symbol.st_value;
    }
  }
}

std::string ImageFile::at(std::uint32_t address, std::size_t size) const {
  for (const LoadedPart& part : parts_) {
    if (address >= part.address && address - part.address < part.bytes.size() &&
        size <= part.bytes.size() - (address - part.address))
      return part.bytes.substr(address - part.address, size);
  }
  throw std::runtime_error("no bytes at address " + std::to_string(address) + " in " + path_);
}

std::uint32_t ImageFile::symbol(const std::string& name) const {
  const auto found = symbols_.find(name);
  if (found == symbols_.end()) throw std::runtime_error("no symbol " + name + " in " + path_);
  return found->second;
}

const std::string& ImageFile::section(const std::string& name) const {
  const auto found = sections_.find(name);
  if (found == sections_.end()) throw std::runtime_error("no section " + name + " in " + path_);
  return found->second;
}

}  // namespace bms::images
