// Updates of a depot's trucks from a table: the manifest of bms fleet (host_sim/fleet/manifest.hpp) with two more
// columns, `bus` and `key`. A truck counts once, by its first row with a bus; rows without one are passed over.
//
//   truck   any text, the truck's name
//   bus     as bms update has it: can0, slcan:/dev/ttyACM0
//   key     file with the device key, relative to the table; empty: none
//
// Batteries have the same identifiers, so a bus is connected to one of them at a time: of the trucks on a bus the first
// one that has not got the image yet is updated, the others wait for a later run. Buses are worked on at the same time.
// The table of what runs where is written after each truck, and a later run leaves out those that are done.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "update/update_run.hpp"

namespace bms::update {

struct Truck {
  std::string name, bus;
  std::filesystem::path key;  ///< absolute; empty: none
};

/// Throws BadInput: no table, no column truck or bus, a truck without a name, no truck with a bus.
std::vector<Truck> read_trucks(const std::filesystem::path& table);

/// A row of the table of what runs where.
struct TruckRow {
  std::string truck, bus, state;  ///< state: done, refused, returned, waiting
  std::string runs;               ///< version; empty: not known
  std::string cell;               ///< cell file of an update that acts; empty: not known, or that of the build
  std::string image;              ///< SHA-256 of the file that was sent
  std::string reason;
};

/// The rows of an earlier run; none if there is no table yet. Throws BadInput for another file.
std::vector<TruckRow> read_rows(const std::filesystem::path& table);

using UpdateOne = std::function<UpdateResult(const Truck&)>;

/// image: SHA-256 of the file that is sent. Calls `done` with each truck that was worked on. Returns all rows, as the
/// table at `out` has them.
std::vector<TruckRow> update_trucks(const std::vector<Truck>& trucks, const std::string& image,
                                    const std::filesystem::path& out, const UpdateOne& update,
                                    const std::function<void(const TruckRow&)>& done);

}  // namespace bms::update
