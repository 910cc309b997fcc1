// Prints the EDS (CiA 306) of an image with BMS_VEHICLE_PROFILE=cia418: what its SDO server answers for every index.
// Names and signs are here; an object without a name, and a name without an object, end the program with 1.
#include <cstdio>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "firmware/cia418_profile.hpp"

namespace bms::hal {

bool can_send(const can::Frame&) { return true; }
bool can_listening() { return false; }

}  // namespace bms::hal

namespace {

using namespace bms::firmware;

struct Named {
  std::string name;
  bool has_sign = false;
  std::vector<std::string> subs = {};  ///< from sub-index 1 on
};

const std::map<unsigned, Named> names{
    {0x1000, {"Device type"}},
    {0x1001, {"Error register"}},
    {0x1008, {"Manufacturer device name"}},
    {0x1017, {"Producer heartbeat time"}},
    {0x1018, {"Identity object", false, {"Vendor-ID", "Product code", "Revision number", "Serial number"}}},
    {0x6000, {"Battery status"}},
    {0x6001, {"Charger status"}},
    {0x6010, {"Temperature", true}},
    {0x6020,
     {"Battery parameters", false, {"Battery type", "Ah capacity", "Maximum charge current", "Number of cells"}}},
    {0x6060, {"Battery voltage"}},
    {0x6070, {"Charge current requested"}},
    {0x6081, {"Battery state of charge"}}};

struct Item {
  canopen::Entry entry;
  bool writable = false;
};

unsigned type_of(const Item& item, bool has_sign) {
  if (!item.entry.text.empty()) return 9;  // VISIBLE_STRING
  const unsigned bytes = item.entry.length == 4 ? 3 : item.entry.length;
  return (has_sign ? 1 : 4) + bytes;  // INTEGER8 is 2, UNSIGNED8 is 5
}

const char* access_of(const Item& item, bool constant) {
  if (constant) return "const";
  return item.writable ? "rw" : "ro";
}

const char* list_of(unsigned index) {
  if (index == 0x1000 || index == 0x1001 || index == 0x1018) return "MandatoryObjects";
  return index >= 0x2000 && index < 0x6000 ? "ManufacturerObjects" : "OptionalObjects";
}

std::string lines_of(const std::string& name, const Item& item, bool has_sign, bool constant) {
  std::string text = fmt::format("ParameterName={}\nObjectType=0x7\nDataType=0x{:04X}\nAccessType={}\n", name,
                                 type_of(item, has_sign), access_of(item, constant));
  if (!item.entry.text.empty()) text += fmt::format("DefaultValue={}\n", item.entry.text);
  if (constant && item.entry.text.empty()) text += fmt::format("DefaultValue={}\n", item.entry.value);
  return text + "PDOMapping=0\n";
}

}  // namespace

int main() {
  Cia418Profile battery;
  const auto ask = [&](unsigned index, unsigned sub) {
    Item item{battery.read(static_cast<std::uint16_t>(index), static_cast<std::uint8_t>(sub))};
    if (item.entry.abort_code == canopen::AbortCode::none)
      item.writable = battery.write(static_cast<std::uint16_t>(index), static_cast<std::uint8_t>(sub), item.entry.value,
                                    item.entry.length) == canopen::AbortCode::none;
    return item;
  };
  std::map<std::string, std::vector<unsigned>> lists{
      {"MandatoryObjects", {}}, {"OptionalObjects", {}}, {"ManufacturerObjects", {}}};
  std::string objects;
  std::size_t found = 0;
  for (unsigned index = 0x1000; index <= 0xFFFF; ++index) {
    const Item first = ask(index, 0), second = ask(index, 1);
    if (first.entry.abort_code != canopen::AbortCode::none) continue;
    const auto known = names.find(index);
    if (known == names.end()) {
      std::fprintf(stderr, "write_eds: object %04X has no name\n", index);
      return 1;
    }
    ++found;
    const Named& named = known->second;
    lists[list_of(index)].push_back(index);
    if (second.entry.abort_code != canopen::AbortCode::none) {
      objects += fmt::format("\n[{:X}]\n{}", index, lines_of(named.name, first, named.has_sign, index == 0x1000));
      continue;
    }
    objects += fmt::format("\n[{:X}]\nParameterName={}\nObjectType=0x9\nSubNumber={}\n", index, named.name,
                           first.entry.value + 1);
    objects += fmt::format("\n[{:X}sub0]\n{}", index, lines_of("Highest sub-index supported", first, false, true));
    for (unsigned sub = 1; sub <= first.entry.value; ++sub)
      objects += fmt::format("\n[{:X}sub{:X}]\n{}", index, sub,
                             lines_of(named.subs.at(sub - 1), ask(index, sub), false, false));
  }
  if (found != names.size()) {
    std::fprintf(stderr, "write_eds: %zu objects, but %zu names\n", found, names.size());
    return 1;
  }
  fmt::print(
      "[FileInfo]\nFileName=greybox_bms.eds\nFileVersion=1\nFileRevision=0\nEDSVersion=4.0\n"
      "Description=Battery module of CiA 418, image with BMS_VEHICLE_PROFILE=cia418\n\n"
      "[DeviceInfo]\nVendorName=\nVendorNumber=0\nProductName=greybox-bms battery\nProductNumber=0\nRevisionNumber=0\n"
      "OrderCode=\nBaudRate_10=0\nBaudRate_20=0\nBaudRate_50=0\nBaudRate_125=1\nBaudRate_250=1\nBaudRate_500=1\n"
      "BaudRate_800=0\nBaudRate_1000=1\nSimpleBootUpMaster=0\nSimpleBootUpSlave=1\nGranularity=0\n"
      "DynamicChannelsSupported=0\nGroupMessaging=0\nNrOfRXPDO=0\nNrOfTXPDO=0\nLSS_Supported=0\n\n"
      "[Comments]\nLines=2\nLine1=Three PDOs with a fixed mapping go to the charger: messages.md.\n"
      "Line2=Generated by tests/firmware/can/write_eds.cpp from what the SDO server answers.\n");
  for (const char* list : {"MandatoryObjects", "OptionalObjects", "ManufacturerObjects"}) {
    const auto& all = lists.at(list);
    fmt::print("\n[{}]\nSupportedObjects={}\n", list, all.size());
    for (std::size_t k = 0; k < all.size(); ++k) fmt::print("{}=0x{:04X}\n", k + 1, all[k]);
  }
  fmt::print("{}", objects);
  return 0;
}
