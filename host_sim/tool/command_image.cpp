// bms image: signed images and cell constants for bms update. Makes keys, signs, shows and checks.
#include <memory>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "files/bad_input.hpp"
#include "files/cell_file.hpp"
#include "files/text_file.hpp"
#include "tool/commands.hpp"
#include "tool/options.hpp"
#include "update/cell_payload.hpp"
#include "update/container_file.hpp"
#include "update/linked_image.hpp"
#include "update/loader_file.hpp"

namespace bms::tool {

namespace {

using update::Container;

struct ImageOptions {
  std::vector<std::string> images, product_keys, development_keys;
  std::string file, key, board, version, oldest_loader = "0.0.0", cell, built, out;
  unsigned security = 0;
  bool development = false;
  Output output;
};

std::string key_text(const Container& c) {
  std::string text;
  for (const std::uint8_t byte : c.header.key) text += fmt::format("{:02x}", byte);
  return text;
}

nlohmann::ordered_json json_of(const Container& c) {
  const boot::Header& h = c.header;
  return {{"kind", h.kind == boot::Kind::application ? "application" : "cell"},
          {"slot", h.slot == 0 ? "a" : "b"},
          {"board", std::string(h.board_name())},
          {"version", update::version_text(h.version)},
          {"security_version", h.security_version},
          {"oldest_loader", update::version_text(h.oldest_loader)},
          {"development", h.development()},
          {"cell_hash", fmt::format("{:08x}", h.cell_hash)},
          {"built_for_cell_hash", fmt::format("{:08x}", h.built_for_cell_hash)},
          {"bytes", h.payload_bytes},
          {"key", key_text(c)},
          {"sha256", files::sha256(c.bytes)}};
}

class ImageCommand final : public Command {
 public:
  CLI::App* add(CLI::App& app) override {
    CLI::App& c = *app.add_subcommand("image", "Make keys; sign, show and check images for bms update");
    c.require_subcommand(1);
    c.footer(
        "Example: bms image sign slot_a.elf slot_b.elf --key product.pem --board stm32f405_forklift --version 0.2.0 "
        "--security-version 1 --out update.bms");
    add_sign(*c.add_subcommand("sign", "Sign an image that is linked for both slots"));
    add_cell(*c.add_subcommand("cell", "Sign the constants of a cell file, for batteries that keep their firmware"));
    CLI::App& show = *c.add_subcommand("show", "Show what a file of signed images states");
    show.add_option("file", o_.file, "signed images")->required()->check(not_empty());
    add_json(show, o_.output);
    CLI::App& verify = *c.add_subcommand("verify", "Check signature and hashes; exit code 1 if one is wrong");
    verify.add_option("file", o_.file, "signed images")->required()->check(not_empty());
    verify.add_option("--key", o_.key, "public or private key, PEM")->required()->check(not_empty())->type_name("FILE");
    CLI::App& loader = *c.add_subcommand("loader", "Write the public keys of a product into its boot loader");
    loader.add_option("file", o_.file, "bms_BOARD_loader.elf")->required()->check(not_empty());
    loader.add_option("--key", o_.product_keys, "public keys, PEM; the second one for the roll-over")
        ->expected(1, 4)
        ->check(not_empty())
        ->type_name("FILE");
    loader
        .add_option("--development-key", o_.development_keys, "the battery is not a product and runs such images too")
        ->expected(1, 2)
        ->check(not_empty())
        ->type_name("FILE");
    loader.add_option("--out", o_.out, "file to write")->required()->check(not_empty())->type_name("FILE");
    CLI::App& key = *c.add_subcommand("key", "Make a private key, and its public key in FILE.pub");
    key.add_option("--out", o_.out, "new file, readable for you only")
        ->required()
        ->check(not_empty())
        ->type_name("FILE");
    sub_ = &c;
    return &c;
  }

  int run() override {
    const std::string what = sub_->get_subcommands().front()->get_name();
    if (what == "sign") return sign();
    if (what == "cell") return cell();
    if (what == "show") return show();
    if (what == "verify") return verify();
    if (what == "loader") return loader();
    update::make_key(o_.out);
    files::write_file(o_.out + ".pub", update::public_pem(update::SigningKey(o_.out)));
    fmt::print("{}: the private key; keep it out of every repository\n{}.pub: the public key, for the loader\n", o_.out,
               o_.out);
    return 0;
  }

 private:
  void add_sign(CLI::App& c) {
    c.add_option("images", o_.images, "ELF images, one for each slot")->required()->expected(1, 2)->check(not_empty());
    c.add_option("--oldest-loader", o_.oldest_loader, "oldest boot loader that may start it")->capture_default_str();
    add_statements(c);
  }
  void add_cell(CLI::App& c) {
    c.footer(
        "Example: bms image cell better.toml --for table9 --key product.pem --board stm32f405_forklift --version 1.0.0 "
        "--security-version 1 --out cell.bms");
    c.add_option("cell", o_.cell, "cell file")->required()->check(not_empty());
    c.add_option("--for", o_.built, "cell file that the batteries' firmware is built with")
        ->required()
        ->check(not_empty())
        ->type_name("CELL");
    add_statements(c);
  }
  /// What signature and header state.
  void add_statements(CLI::App& c) {
    c.add_option("--key", o_.key, "private key: PEM file, or org.openssl.engine:pkcs11:pkcs11:...")
        ->required()
        ->check(not_empty());
    c.add_option("--board", o_.board, "folder in boards/")->required()->check(not_empty());
    c.add_option("--version", o_.version, "for example 0.2.0")->required();
    c.add_option("--security-version", o_.security, "raise it when older images must not run again")
        ->required()
        ->check(Within(0, 224));
    c.add_flag("--development", o_.development, "for batteries with a development loader only");
    c.add_option("--out", o_.out, "file to write")->required()->check(not_empty())->type_name("FILE");
  }

  void state(boot::Header& header, const std::string& oldest_loader) const {
    if (o_.board.size() >= boot::board_name_bytes)
      throw files::BadInput("--board", 1, fmt::format("'{}' is too long, expected at most 31 characters", o_.board));
    std::ranges::copy(o_.board, header.board.begin());
    header.version = update::read_version("--version", o_.version);
    header.security_version = o_.security;
    header.oldest_loader = update::read_version("--oldest-loader", oldest_loader);
    header.flags = o_.development ? boot::flag_development : 0;
  }

  int sign() {
    std::vector<update::Payload> payloads;
    for (const std::string& image : o_.images) {
      update::Payload p = update::read_linked_image(image);
      if (!payloads.empty() && payloads.front().header.slot == p.header.slot)
        throw files::BadInput(image, 1, "is linked for the same slot as the first image, expected the other one");
      if (!payloads.empty() && payloads.front().header.cell_hash != p.header.cell_hash)
        throw files::BadInput(image, 1, "has another cell file than the first image");
      state(p.header, o_.oldest_loader);
      payloads.push_back(std::move(p));
    }
    return write(std::move(payloads));
  }

  int cell() {
    constexpr const char* first_loader_with_cells = "0.2.0";
    auto payloads = update::cell_payloads(files::read_cell(o_.cell), files::read_cell(o_.built));
    for (update::Payload& p : payloads) state(p.header, first_loader_with_cells);
    return write(std::move(payloads));
  }

  int write(std::vector<update::Payload> payloads) {
    std::string all;
    for (const Container& c : update::sign(std::move(payloads), update::SigningKey(o_.key))) all += c.bytes;
    files::write_file(o_.out, all);
    return show(o_.out);
  }

  int loader() {
    std::vector<update::LoaderKey> keys;
    for (const std::string& key : o_.product_keys) keys.push_back({update::read_public_key(key), false});
    for (const std::string& key : o_.development_keys) keys.push_back({update::read_public_key(key), true});
    update::write_loader(o_.file, keys, o_.out);
    fmt::print("{}: a boot loader with {} key{}{}\n", o_.out, keys.size(), keys.size() == 1 ? "" : "s",
               o_.development_keys.empty() ? "" : ", for development");
    return 0;
  }

  int show() { return show(o_.file); }
  int show(const std::string& file) {
    nlohmann::ordered_json all = nlohmann::ordered_json::array();
    for (const Container& c : update::read_containers(file)) {
      all.push_back(json_of(c));
      if (o_.output.quiet || o_.output.json == "-") continue;
      fmt::print("{}: {} {} for {}, slot {}, {} bytes, security version {}, cell {:08x}, key {}{}\n", file,
                 c.header.kind == boot::Kind::application ? "application" : "cell constants",
                 update::version_text(c.header.version), c.header.board_name(), c.header.slot == 0 ? "A" : "B",
                 c.header.payload_bytes, c.header.security_version, c.header.cell_hash, key_text(c),
                 c.header.development() ? ", for development" : "");
    }
    const nlohmann::ordered_json result{{"command", "image"}, {"images", all}};
    if (!o_.output.json.empty()) write_output(o_.output.json, result.dump(2) + "\n");
    return 0;
  }

  int verify() {
    const boot::PublicKey key = update::read_public_key(o_.key);
    bool right = true;
    for (const Container& c : update::read_containers(o_.file)) {
      const boot::Refusal why = update::check(c, key);
      right = right && why == boot::Refusal::none;
      fmt::print("{}: slot {}: {}\n", o_.file, c.header.slot == 0 ? "A" : "B",
                 why == boot::Refusal::none ? "signature and hashes are right" : boot::words_for(why));
    }
    return right ? 0 : 1;
  }

  ImageOptions o_;
  CLI::App* sub_ = nullptr;
};

}  // namespace

std::unique_ptr<Command> image_command() { return std::make_unique<ImageCommand>(); }

}  // namespace bms::tool
