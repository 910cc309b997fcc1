#include "tests/firmware/stack_depth.hpp"

#include <algorithm>
#include <cstring>
#include <optional>
#include <set>
#include <sstream>
#include <stdexcept>

#include <fmt/format.h>

#include "images/child_process.hpp"
#include "images/image_file.hpp"
#include "tests/firmware/elf_image.hpp"

namespace bms::firmware {

namespace {

struct Instruction {
  std::uint32_t address = 0;
  std::string name, operands;
};

/// Name and operands without the remarks of objdump and without width suffixes (.w, .n).
Instruction instruction_of(const std::string& line) {
  std::istringstream in(line);
  Instruction i;
  std::string address, bytes;
  std::getline(in, address, '\t');
  std::getline(in, bytes, '\t');
  std::getline(in, i.name, '\t');
  std::getline(in, i.operands);
  i.address = static_cast<std::uint32_t>(std::stoul(address, nullptr, 16));
  i.name = i.name.substr(0, i.name.find_last_not_of(' ') + 1);
  if (i.name.ends_with(".w") || i.name.ends_with(".n")) i.name.resize(i.name.size() - 2);
  return i;
}

bool one_of(const std::string& name, std::initializer_list<const char*> names) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

/// Bytes of the registers in "{r4, r5, lr}", "{d8-d9}", "{s16-s19}".
std::int32_t bytes_of_list(const std::string& operands) {
  std::string list = operands.substr(operands.find('{') + 1);
  list.resize(list.find('}'));
  std::int32_t bytes = 0;
  std::istringstream in(list);
  for (std::string item; std::getline(in, item, ',');) {
    item.erase(0, item.find_first_not_of(' '));
    const std::size_t dash = item.find('-');
    const int count =
        dash == std::string::npos ? 1 : std::stoi(item.substr(dash + 2)) - std::stoi(item.substr(1, dash - 1)) + 1;
    bytes += count * (item[0] == 'd' ? 8 : 4);
  }
  return bytes;
}

std::int32_t after_hash(const std::string& operands) { return std::stoi(operands.substr(operands.rfind('#') + 1)); }

/// Bytes that an instruction adds to the stack; negative if it removes some. literals: constants in registers, with
/// which ARMv6-M makes large frames.
std::int32_t pushed(const Instruction& i, const std::map<std::string, std::int32_t>& literals, std::int32_t large_frame,
                    const std::string& function) {
  const std::string& o = i.operands;
  const bool of_stack = o.starts_with("sp,") || o.starts_with("sp!");
  if (i.name == "push" || i.name == "vpush") return bytes_of_list(o);
  if (i.name.starts_with("pop") || i.name.starts_with("vpop")) return -bytes_of_list(o);
  if (i.name == "stmdb" && o.starts_with("sp!")) return bytes_of_list(o);
  if (i.name.starts_with("ldmia") && o.starts_with("sp!")) return -bytes_of_list(o);
  if (o.find("[sp, #-") != std::string::npos && o.ends_with("]!")) return -after_hash(o);
  if (o.find("[sp], #") != std::string::npos) return -after_hash(o);
  if (!of_stack) return 0;
  const bool adds = i.name.starts_with("add"), subtracts = i.name.starts_with("sub");
  const bool of_constant = o.find('#') != std::string::npos;
  if ((adds || subtracts) && of_constant)
    return adds ? -after_hash(o.substr(0, o.find('@'))) : after_hash(o.substr(0, o.find('@')));
  const std::string by = o.substr(o.rfind(' ') + 1);
  if (adds && literals.contains(by) && literals.at(by) < 0) return -literals.at(by);
  if (adds && large_frame > 0) return -large_frame;
  if (i.name.starts_with("str") || i.name.starts_with("stm") || i.name.starts_with("cmp")) return 0;
  throw std::runtime_error("the stack pointer is computed in " + function + ": " + i.name + " " + o);
}

bool returns(const Instruction& i) {
  return (i.name == "bx" && i.operands == "lr") ||
         (one_of(i.name, {"pop", "ldmia"}) && i.operands.find("pc") != std::string::npos) ||
         (i.name == "ldr" && i.operands.starts_with("pc, [sp]"));
}

std::optional<std::uint32_t> target(const Instruction& i) {
  const bool branch = i.name[0] == 'b' && !one_of(i.name, {"bic", "bics", "bfi", "bfc", "bkpt", "bx", "blx"}) &&
                      !i.name.starts_with("bic");
  if (!branch && i.name != "cbz" && i.name != "cbnz") return std::nullopt;
  const std::size_t open = i.operands.find(" <");
  if (open == std::string::npos) return std::nullopt;
  const std::size_t begin = i.name[0] == 'c' ? i.operands.find(' ') + 1 : 0;
  return static_cast<std::uint32_t>(std::stoul(i.operands.substr(begin, open - begin), nullptr, 16));
}

/// Analyses one function; its instructions are in the order of their addresses. After an unseen jump (from a table, or
/// backwards) the depth is the deepest so far.
Function function_of(const std::string& name, const std::vector<Instruction>& body,
                     const std::map<std::uint32_t, std::int32_t>& words) {
  Function f{name, 0, {}, false};
  std::map<std::uint32_t, std::int32_t> depth_at;
  std::map<std::string, std::int32_t> literals;
  std::int32_t depth = 0, deepest = 0, large_frame = 0;
  std::string popped;
  bool falls_through = true;
  for (const Instruction& i : body) {
    if (const auto known = depth_at.find(i.address); known != depth_at.end())
      depth = falls_through ? std::max(depth, known->second) : known->second;
    else if (!falls_through)
      depth = deepest;
    falls_through = true;
    if (i.name == "msr" && i.operands.starts_with("MSP")) depth = deepest = 0;
    if (const std::size_t at = i.operands.find("@ ("); i.name == "ldr" && at != std::string::npos) {
      const auto word = words.find(static_cast<std::uint32_t>(std::stoul(i.operands.substr(at + 3), nullptr, 16)));
      if (word != words.end()) literals[i.operands.substr(0, i.operands.find(','))] = word->second;
    } else {
      literals.erase(i.operands.substr(0, i.operands.find(',')));
    }
    const bool conditional =
        i.name.starts_with("pop") && i.name != "pop";  // in an IT block: the other path has not removed it
    const std::int32_t more = conditional ? 0 : pushed(i, literals, large_frame, name);
    if (i.name == "add" && i.operands.starts_with("sp, r") && more > 0) large_frame = more;
    if (i.name == "pop") popped = i.operands;
    depth += more;
    if (depth < 0) throw std::runtime_error("more is removed from the stack than was added in " + name);
    deepest = std::max(deepest, depth);
    if (const auto to = target(i)) {
      const bool own = *to >= body.front().address && *to <= body.back().address;
      const bool call =
          i.name == "bl" && (!own || *to == body.front().address);  // ARMv6-M jumps by bl beyond the range of b
      if (own && !call) depth_at[*to] = std::max(depth_at[*to], depth);
      if (!call && *to == body.front().address && depth > 0)
        throw std::runtime_error("a loop that takes more stack each time in " + name);
      if (!own || call) f.calls.push_back(*to);
      falls_through = i.name != "b" && (i.name != "bl" || call);
    } else if (returns(i) || one_of(i.name, {"tbb", "tbh", "udf"}) ||
               (i.name == "mov" && i.operands.starts_with("pc,"))) {
      falls_through = false;  // mov pc: a jump table without tbb
    } else if (i.name == "bx" && popped.find(i.operands) != std::string::npos) {
      falls_through = false;  // a return on cores whose pop cannot change the instruction set
    } else if (i.name == "blx" || i.name == "bx" || (i.name == "ldr" && i.operands.starts_with("pc,"))) {
      f.by_pointer |= i.operands != "lr";
      falls_through = i.name == "blx";
    }
  }
  f.stack = static_cast<std::uint32_t>(deepest);
  return f;
}

class Deepest {
 public:
  Deepest(const Functions& functions, const ByPointer& by_pointer) : functions_(functions), by_pointer_(by_pointer) {}

  Depth from(std::uint32_t address) {
    auto found = functions_.upper_bound(address);  // library functions may have a second entry
    if (found == functions_.begin())
      throw std::runtime_error(fmt::format("a call to {:#x}, where no function is", address));
    address = (--found)->first;
    if (const auto done = known_.find(address); done != known_.end()) return done->second;
    const Function& f = found->second;
    const std::uint32_t times = repeated(f);
    if (!active_.insert(address).second) throw std::runtime_error("recursion: " + f.name);
    Depth below;
    for (const std::uint32_t callee : callees(f)) {
      if (callee == address && times > 1) continue;
      Depth d = from(callee);
      if (d.bytes > below.bytes || below.path.empty()) below = std::move(d);
    }
    active_.erase(address);
    below.bytes += times * f.stack;
    below.path.insert(below.path.begin(), f.name);
    return known_[address] = below;
  }

 private:
  /// Number of activations of a function that calls itself a known number of times.
  static std::uint32_t repeated(const Function& f) {
    const bool halves = f.name.find("bms::arithmetic::step_response<") !=
                        std::string::npos;  // arithmetic/exponential.hpp: from 32 down to 1/4
    return halves ? 1 + 7 : 1;
  }
  std::vector<std::uint32_t> callees(const Function& f) const {
    std::vector<std::uint32_t> all = f.calls;
    if (!f.by_pointer) return all;
    const auto named = std::find_if(by_pointer_.begin(), by_pointer_.end(),
                                    [&](const auto& entry) { return f.name.starts_with(entry.first); });
    if (named == by_pointer_.end()) throw std::runtime_error("a call by pointer in " + f.name);
    for (const std::string& begin : named->second) {
      for (const auto& [address, other] : functions_) {
        if (other.name.starts_with(begin)) all.push_back(address);
      }
    }
    return all;
  }

  const Functions& functions_;
  const ByPointer& by_pointer_;
  std::map<std::uint32_t, Depth> known_;
  std::set<std::uint32_t> active_;
};

/// Calls by pointer in the images: constructors from reset, who listens for updates (an image without a slot has
/// nobody), the surroundings of the update server, and the switch tables of libgcc, which return into their caller.
const ByPointer& calls_by_pointer() {
  static const ByPointer known = {
      {"reset_handler", {"_GLOBAL__sub_I_"}},
      {"bms::hal::dispatch_frame", {"bms::firmware::UpdateService::receive"}},
      {"mbedtls_platform_zeroize", {"memset"}},
      {"bms::boot::",
       {"bms::boot::ChipSlots::", "bms::boot::check_fields_and_key(", "bms::firmware::check_cell_constants",
        "bms::firmware::UpdateService::at_rest", "bms::firmware::UpdateService::challenge",
        "bms::firmware::UpdateService::restart("}},
      {"__gnu_thumb1_case_", {}}};
  return known;
}

}  // namespace

Functions functions_of(const std::string& disassembly) {
  std::map<std::uint32_t, std::int32_t> words;
  std::vector<std::pair<std::string, std::vector<Instruction>>> bodies;
  std::istringstream lines(disassembly);
  for (std::string line; std::getline(lines, line);) {
    if (line.ends_with(">:")) {
      bodies.emplace_back(line.substr(line.find('<') + 1, line.size() - line.find('<') - 3),
                          std::vector<Instruction>{});
    } else if (line.starts_with(" ") && line.find(":\t") != std::string::npos && !bodies.empty()) {
      const Instruction i = instruction_of(line);
      if (i.name == ".word")
        words[i.address] = static_cast<std::int32_t>(std::stoul(i.operands, nullptr, 16));
      else if (!i.name.starts_with("."))
        bodies.back().second.push_back(i);
    }
  }
  Functions functions;
  for (const auto& [name, body] : bodies) {
    if (!body.empty()) functions[body.front().address] = function_of(name, body, words);
  }
  return functions;
}

Depth depth_from(const Functions& functions, std::uint32_t root, const ByPointer& by_pointer) {
  return Deepest(functions, by_pointer).from(root);
}

StackDepth stack_depth(const std::filesystem::path& image) {
  const std::string text = images::output_of({"arm-none-eabi-objdump", "--disassemble", "--demangle", image.string()});
  const Functions functions = functions_of(text);
  Deepest deepest(functions, calls_by_pointer());
  const std::string table = images::ImageFile(image).section(".vectors");
  std::vector<std::uint32_t> vectors(table.size() / 4);
  std::memcpy(vectors.data(), table.data(), 4 * vectors.size());
  StackDepth depth;
  depth.reset = deepest.from(vectors.at(1) & ~1U);
  std::set<std::uint32_t> handlers(vectors.begin() + 2, vectors.end());
  for (const std::uint32_t handler : handlers) {
    if (handler == 0) continue;
    const std::string& name = functions.at(handler & ~1U).name;
    if (one_of(name, {"fault_handler", "clock_failure_interrupt"})) continue;
    Depth d = deepest.from(handler & ~1U);
    Depth& level = one_of(name, {"can1_tx_interrupt", "can1_rx0_interrupt", "usart1_interrupt"}) ? depth.low_interrupt
                                                                                                 : depth.interrupt;
    if (d.bytes >= level.bytes) level = std::move(d);
  }
  depth.frame =
      4 * (text.find("\tvmsr\t") != std::string::npos || text.find("\tvldr\t") != std::string::npos ? 26 + 1 : 8 + 1);
  return depth;
}

}  // namespace bms::firmware
