#include "tests/firmware/world/group_world.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "files/cell_file.hpp"
#include "images/chosen_image.hpp"
#include "monitor/parameters.hpp"
#include "monitor/service_client.hpp"
#include "tests/cell_of_capacity.hpp"

namespace bms::world {

namespace {

constexpr std::uint32_t bus_bits_per_second = 250'000, limits_id = 0x111,
                        canopen_request_id = 0x40A;  // of receive PDO 3 of the charger

/// First identifier of a battery on the truck's bus. With 0x180 a third one would have that of a CANopen charger.
std::uint16_t base_of(std::int32_t node, std::int32_t batteries) {
  return static_cast<std::uint16_t>((batteries > 2 ? 0x100 : 0x180) + 0x40 * std::max(node - 1, 0));
}

std::uint64_t field(const can::Frame& frame, unsigned first, unsigned bits) {
  std::uint64_t all = 0;
  for (unsigned k = 0; k < 8; ++k) all |= static_cast<std::uint64_t>(frame.data[k]) << 8 * k;
  return all >> first & ((std::uint64_t{1} << bits) - 1);
}

void read(SeenPresence& seen, const can::Frame& frame, double at_ms) {
  seen.any = true;
  seen.at_ms = at_ms;
  if (frame.id >= limits_id) {
    seen.discharge_a = 0.1 * static_cast<double>(field(frame, 16, 16));
    seen.charge_a = 0.1 * static_cast<double>(field(frame, 32, 16));
    return;
  }
  seen.state = static_cast<unsigned>(field(frame, 12, 2));
  seen.leader = static_cast<unsigned>(field(frame, 14, 3));
  seen.granted = static_cast<unsigned>(field(frame, 17, 3));
  seen.open_circuit_v = 0.002 * static_cast<double>(field(frame, 24, 16));
  seen.current_a = 0.1 * static_cast<std::int16_t>(field(frame, 40, 16));
}

WorldSetup in_parallel(WorldSetup setup) {
  setup.truck.in_parallel = true;
  return setup;
}

/// Of a battery after its workshop.
const std::vector<std::uint8_t>& flash_of(const Pack& pack, std::int32_t node, std::int32_t batteries) {
  static std::map<std::tuple<std::filesystem::path, std::int32_t, std::int32_t>, std::vector<std::uint8_t>> known;
  auto& flash = known[{pack.image, node, batteries}];
  if (!flash.empty()) return flash;
  TruckWorld world(pack.image, typical_setup(pack));
  world.fit_charger_bus(bus_bits_per_second);
  world.run_ms(2'000);
  if (node != 0 && !set_group(world, node, batteries)) throw std::runtime_error("the group was not set");
  world.run_ms(500);
  return flash = world.board.flash.bytes;
}

}  // namespace

const Pack& parallel_pack(const std::string& vehicle_profile) {
  static std::map<std::string, Pack> packs;
  const auto known = packs.find(vehicle_profile);
  if (known != packs.end()) return known->second;
  const Pack pack = [&] {
    files::CellFile cell = files::read_cell("table9");
    cell.parameters = tests::of_capacity(cell.parameters, truck_ah);
    cell.name = "table9_100ah";
    cell.source = "table9 with the capacity of 100 Ah";
    cell = files::parse_cell(files::cell_text(cell), cell.name);
    return Pack{truck_ah, cell.parameters.limits.discharge_current_max_a, 24,
                images::chosen_image("stm32f405_80v", cell,
                                     {vehicle_profile == "none" ? "parallel" : "parallel-" + vehicle_profile,
                                      {"-DBMS_PARALLEL=ON", "-DBMS_VEHICLE_PROFILE=" + vehicle_profile}})};
  }();
  return packs.emplace(vehicle_profile, pack).first->second;
}

bool set_group(TruckWorld& world, std::int32_t node, std::int32_t batteries) {
  monitor::ReceivedParameters all;
  const auto before = std::exchange(world.vehicle.on_frame, [&](const can::Frame& f) { all.receive(f); });
  world.vehicle.send(monitor::ReceivedParameters::request(1));
  world.run_until([&] { return all.complete(); }, 8'000);
  if (!all.complete()) return false;
  auto wanted = all.raw();
  wanted[monitor::find_parameter("group_node")->number - 1U] = node;
  wanted[monitor::find_parameter("group_batteries")->number - 1U] = batteries;
  wanted[monitor::find_parameter("can_base")->number - 1U] = base_of(1, batteries);
  monitor::ServiceClient client({}, 42, monitor::commands_to_set(all.raw(), wanted));
  world.vehicle.on_frame = [&](const can::Frame& f) { client.receive(f, world.now_s()); };
  for (int k = 0; k < 400 && client.state() == monitor::ServiceClient::State::working; ++k) {
    for (const can::Frame& f : client.due(world.now_s())) world.vehicle.send(f);
    world.run_ms(50);
  }
  world.vehicle.on_frame = before;
  return client.state() == monitor::ServiceClient::State::done;
}

Group::Group(const std::vector<Battery>& batteries, const std::string& vehicle_profile) {
  const Pack& pack = parallel_pack(vehicle_profile);
  for (const Battery& b : batteries) {
    worlds.push_back(std::make_unique<TruckWorld>(pack.image, in_parallel(b.setup)));
    TruckWorld& world = *worlds.back();
    world.board.flash.bytes = flash_of(pack, b.node, b.batteries);
    world.vehicle.base = base_of(b.node, b.batteries);
    world.fit_charger_bus(bus_bits_per_second);
    world.vehicle.on_frame = [this, &world, k = worlds.size() - 1](const can::Frame& frame) {
      if (charger == nullptr) return;
      charger->receive(frame, world.now_s());
      if (frame.long_id || frame.id == canopen_request_id) ++to_charger[k];
    };
  }
  on_the_bus.assign(worlds.size(), true);
  powered.assign(worlds.size(), true);
  was_connected_.assign(worlds.size(), false);
  over_ms_.assign(worlds.size(), 0);
  presence.resize(4);
}

void Group::run_ms(double ms) {
  for (double passed = 0; passed < ms - 1e-6; passed += slice_ms) {
    load_a_ = charger != nullptr ? -charger_a() : followed_a();
    for (const auto& world : worlds) {
      world->truck.set_drive({.power_w = 0, .current_a = load_a_});
      world->run_ms(slice_ms);
    }
    pass_frames();
    pass_sources();
    watch();
  }
}

void Group::pass_frames() {
  for (std::size_t k = 0; k < worlds.size(); ++k) {
    auto& can = worlds[k]->charger_bus->can;
    bool others = false;
    for (std::size_t other = 0; other < worlds.size(); ++other)
      others = others || (other != k && on_the_bus[k] && on_the_bus[other]);
    can.others_acknowledge = others;
    for (const firmware::SeenFrame& seen : std::exchange(can.seen, {})) {
      if (!seen.from_board) continue;
      const std::uint32_t node = (seen.frame.id & 0xF) - 1;
      if (node < presence.size()) read(presence[node], seen.frame, worlds[k]->now_ms());
      for (std::size_t other = 0; other < worlds.size(); ++other) {
        if (other == k || !on_the_bus[k] || !on_the_bus[other]) continue;
        worlds[other]->charger_bus->can.others.push_back({firmware::wire_frame(seen.frame), 0, true});
      }
    }
  }
}

void Group::pass_sources() {
  for (std::size_t k = 0; k < worlds.size(); ++k) {
    plant::LinkSource all;
    double amperes = 0;
    for (std::size_t other = 0; other < worlds.size(); ++other) {
      if (other == k) continue;
      const plant::LinkSource source = worlds[other]->truck.link_source();
      all.siemens += source.siemens;
      amperes += source.siemens * source.emf_v;
    }
    all.emf_v = all.siemens > 0 ? amperes / all.siemens : 0;
    worlds[k]->truck.set_other_batteries(all);
  }
}

double Group::followed_a() {
  allowed_before_.push_back(allowed_a());
  while (static_cast<double>(allowed_before_.size() - 1) * slice_ms > truck_follows_ms) allowed_before_.pop_front();
  const auto [discharge_a, charge_a] = allowed_before_.front();
  return connected() > 0 ? std::clamp(demand_a, -charge_a, discharge_a) : 0;
}

/// The charger's current, and its frames to all batteries.
double Group::charger_a() {
  const double now_s = worlds[0]->now_s();
  const auto closed = [](const auto& w) { return w->both_mains_closed() && w->closed(plant::Relay::charge); };
  const auto at = std::ranges::find_if(worlds, closed);
  const double volts = at != worlds.end() ? (*at)->truck.voltages().dc_link_v() : 0;
  const double amperes = charger->current_a(volts, at != worlds.end(), now_s);
  charger->measured(volts, amperes);
  for (const can::Frame& frame : charger->send(now_s)) {
    for (const auto& world : worlds) world->board.can.others.push_back({firmware::wire_frame(frame), 0, true});
  }
  return amperes;
}

void Group::watch() {
  no_load_ms_ = load_a_ == 0 ? no_load_ms_ + slice_ms : 0;
  double siemens = 0, amperes = 0;
  for (std::size_t k = 0; k < worlds.size(); ++k) {
    const bool connected_now = worlds[k]->both_mains_closed();
    // alone, a battery charges the capacitor of the DC link with what is left after its precharge
    if (no_load_ms_ > 50 && connected_now && connected() > 1)
      largest_equalising_a = std::max(largest_equalising_a, std::abs(worlds[k]->truck.current_a()));
    if (connected_now && !was_connected_[k]) watch_closing(k);
    was_connected_[k] = connected_now;
    watch_limit(k);
    if (!connected_now) continue;
    const plant::LinkSource source = worlds[k]->truck.link_source();
    siemens += source.siemens;
    amperes += source.siemens * source.emf_v;
  }
  for (const auto& world : worlds) {
    if (!world->both_mains_closed()) continue;
    const plant::LinkSource source = world->truck.link_source();
    largest_sudden_a = std::max(largest_sudden_a, std::abs(source.siemens * (amperes / siemens - source.emf_v)));
  }
}

void Group::watch_closing(std::size_t k) {
  bool next_to_another = false;
  for (std::size_t other = 0; other < worlds.size(); ++other) {
    if (other == k || !was_connected_[other]) continue;
    next_to_another = true;
    largest_closing_difference_v =
        std::max(largest_closing_difference_v, std::abs(open_circuit_v(k) - open_circuit_v(other)));
  }
  joined += next_to_another ? 1 : 0;
}

void Group::watch_limit(std::size_t k) {
  const double a = worlds[k]->truck.current_a(), limit_a = a < 0 ? presence[k].discharge_a : presence[k].charge_a;
  const bool loaded = load_a_ != 0 && worlds[k]->both_mains_closed();
  if (loaded && limit_a > 0) largest_use = std::max(largest_use, std::abs(a) / limit_a);
  over_ms_[k] = loaded && std::abs(a) > 1.05 * limit_a ? over_ms_[k] + slice_ms : 0;
  longest_over_ms = std::max(longest_over_ms, over_ms_[k]);
}

std::size_t Group::connected() const {
  return static_cast<std::size_t>(std::ranges::count_if(worlds, [](const auto& w) { return w->both_mains_closed(); }));
}

void Group::request(Request wanted) {
  for (const auto& world : worlds) world->vehicle.request = wanted;
}

std::pair<double, double> Group::allowed_a() const {
  std::pair<double, double> most{0, 0};
  for (const auto& world : worlds) {
    if (world->vehicle.silent_ms() >= 1'500) continue;
    most.first = std::max(most.first, world->vehicle.allowed_discharge_a());
    most.second = std::max(most.second, world->vehicle.allowed_charge_a());
  }
  return most;
}

double Group::open_circuit_v(std::size_t k) const {
  static const plant::MonotoneCurve curve = plant::table9_ocv_v();
  plant::CellString& cells = worlds[k]->truck.cells();
  double v = 0;
  for (std::size_t cell = 0; cell < cells.size(); ++cell) v += curve.at(cells.soc(cell));
  return v;
}

bool Group::key_off() {
  demand_a = 0;
  run_ms(500);
  request(Request::none);
  return run_until([&] { return connected() == 0; }, 8'000) >= 0;
}

std::string text_of(const Group& group) {
  std::string text;
  for (std::size_t k = 0; k < group.worlds.size(); ++k) {
    const SeenPresence& p = group.presence[k];
    text += fmt::format("\n  {}: {}; state {} leader {} granted {}, OCV {:.2f} V, {:.1f} A", k + 1,
                        summary(*group.worlds[k]), p.state, p.leader, p.granted, p.open_circuit_v, p.current_a);
  }
  return text;
}

}  // namespace bms::world
