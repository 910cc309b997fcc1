// Why an image, or a step of its transfer, is refused. The numbers are sent on CAN (data identifier 0xF1A4 of
// update_server.hpp), so they never change their meaning.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace bms::boot {

enum class Refusal : std::uint8_t {
  none,
  not_a_header,
  header_damaged,
  other_board,
  other_slot,
  unknown_key,
  revoked_key,
  bad_signature,
  development_image,
  older_security,
  newer_loader_needed,
  too_large,
  block_damaged,
  incomplete,
  already_running,
  not_at_rest,
  not_erased,
  no_session,
  flash_failed,
  trial_failed,
  not_from_the_other_slot,
  other_kind,
  not_confirmed,
  erase_at_restart,
  other_cell_file,
  unknown_cell_format,
  other_model,
  other_limits,
  cell_out_of_range,
};

/// What a slot that was accepted is refused for only if its content has changed since. The other reasons also follow
/// from another application, key or counter.
constexpr bool says_damaged(Refusal refusal) {
  return refusal == Refusal::not_a_header || refusal == Refusal::header_damaged || refusal == Refusal::bad_signature ||
         refusal == Refusal::block_damaged;
}

/// For a person, in the order of Refusal.
inline constexpr std::array<std::string_view, 29> refusal_words{
    "accepted",
    "this is not an image of this format",
    "the image's header is inconsistent",
    "the image is for another board",
    "the image is for the other slot",
    "the image is signed with a key that this battery does not have",
    "the image is signed with a key that was revoked",
    "the signature of the image is wrong",
    "this is a development image, and the battery is a product",
    "the image is older than this battery may run (its security version is below the battery's counter)",
    "the image needs a newer boot loader",
    "the image is larger than a slot",
    "a block of the image does not have the hash that its header states",
    "the image is not complete",
    "the battery runs this image already",
    "the battery is not at rest; open the contactors first",
    "the slot is not erased",
    "no service session is open",
    "the flash could not be written",
    "the image was started on trial and did not confirm itself",
    "the image would overwrite the running one",
    "this battery has no slot for that kind of data, or the slot holds another kind",
    "what was sent before is on trial or waits for a restart; restart, and wait until it has confirmed itself",
    "the battery restarts to erase the slot; it continues afterwards",
    "the cell constants are for firmware that was built with another cell file",
    "the cell constants have a format that the firmware does not know",
    "the cell constants need a model that the firmware does not have",
    "the cell constants have other limits or another capacity than the firmware, which protects by its own",
    "a cell constant is outside the range that a cell file may have",
};

constexpr std::string_view words_for(Refusal refusal) {
  const auto k = static_cast<std::size_t>(refusal);
  return k < refusal_words.size() ? refusal_words[k] : std::string_view("refused for a reason that this tool lacks");
}

}  // namespace bms::boot
