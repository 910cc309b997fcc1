#include "hal/frame_dispatch.hpp"

#include "hal/request_queue.hpp"
#include "hal/requests.hpp"
#include "hal/sample_frames.hpp"
#include "hal/update_frames.hpp"

namespace bms::hal {

namespace {

RequestQueue requests;
void (*update_listener)(const can::Frame&) = nullptr;

}  // namespace

void listen_for_updates(void (*listener)(const can::Frame& frame)) { update_listener = listener; }

bool dispatch_frame(const can::Frame& frame) {
  if (!frame.long_id && frame.id == update_frame_id) {
    if (update_listener != nullptr) update_listener(frame);
    return false;
  }
  if (is_sample_frame(frame)) return true;
  requests.push(frame);
  return false;
}

bool next_request(can::Frame& frame) { return requests.pop(frame); }
bool next_network_frame(can::Frame& frame) { return requests.pop_network(frame); }

}  // namespace bms::hal
