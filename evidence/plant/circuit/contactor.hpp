// A contactor or a relay: from the voltage at its coil to the position of its contacts.
//
// The armature begins to move when the coil reaches its pull-in voltage, and to fall when it is below its drop-out
// voltage; between both it stays. After the closing time the contact touches, bounces and rests; after the opening time
// it is open. Movements that are reversed before the contact has changed leave it as it was.
// The auxiliary contact is a mirror contact: it follows the main contact, also when that is welded, without bounce.
#pragma once

#include <vector>

#include "plant/random.hpp"

namespace bms::plant {

struct TimeRange {
  double least_s, most_s;
};

struct ContactorParameters {
  TimeRange closing = {0.015, 0.030}, opening = {0.005, 0.015}, bounce = {0.001, 0.005};
  double coil_ohm = 18, coil_time_constant_s = 0.01;
  double rated_v = 12;
  double pull_in_share = 0.7, drop_out_share = 0.3;  ///< of the rated voltage
};

enum class ContactorFault {
  none,
  welded,       ///< the main contact stays closed
  open_coil,    ///< no current flows through the coil
  no_drop_out,  ///< the armature stays attracted once it was
  no_contact,   ///< the armature moves, the main contact stays open (burnt, or its cable is off)
};

enum class AuxiliaryFault { none, stuck_open, stuck_closed };

class Contactor {
 public:
  Contactor(const ContactorParameters& parameters, std::uint64_t seed) : parameters_(parameters), random_(seed) {}

  void set_fault(ContactorFault fault) { fault_ = fault; }
  void set_auxiliary_fault(AuxiliaryFault fault) { auxiliary_fault_ = fault; }
  /// Multiplies the closing and the opening time of later movements.
  void set_slowness(double factor) { slowness_ = factor; }

  /// Voltage at the coil from now on. It may start or reverse a movement.
  void set_coil_v(double coil_v);
  void advance(double duration_s);
  /// Time to the next change of the main contact at this coil voltage; infinite if it rests.
  double next_change_s() const;

  bool closed() const;  ///< main contact
  bool bouncing() const { return !bounce_s_.empty(); }
  /// The last change of the main contact was not the first touch of its closing.
  bool last_change_bounced() const { return armature_ == Armature::closed && changes_ > 0; }
  bool auxiliary_closed() const;
  double coil_a() const { return coil_a_; }

 private:
  enum class Armature { open, closing, closed, opening };
  double draw_s(const TimeRange& range);
  void touch();

  ContactorParameters parameters_;
  Random random_;
  ContactorFault fault_ = ContactorFault::none;
  AuxiliaryFault auxiliary_fault_ = AuxiliaryFault::none;
  double slowness_ = 1, coil_v_ = 0, coil_a_ = 0;
  Armature armature_ = Armature::open;
  double rest_s_ = 0;             ///< of the movement
  int changes_ = 0;               ///< of the contact since its first touch
  bool touching_ = false;         ///< the main contact, without its faults
  std::vector<double> bounce_s_;  ///< times to the coming changes of the contact, the last one first
};

}  // namespace bms::plant
