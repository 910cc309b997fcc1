#include "fleet/database.hpp"

#include <sqlite3.h>

#include <stdexcept>

#include "files/bad_input.hpp"

namespace bms::fleet {

namespace {

void check(sqlite3* database, int result) {
  if (result != SQLITE_OK && result != SQLITE_DONE && result != SQLITE_ROW)
    throw files::BadInput(
        sqlite3_db_filename(database, "main"), 1,
        std::string(sqlite3_errmsg(database)) + ", expected a table that bms fleet merge has written");
}

}  // namespace

void Statement::Finalize::operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
void Database::Close::operator()(sqlite3* database) const { sqlite3_close(database); }

Statement::Statement(Database& database, std::string_view sql) : database_(database.handle()) {
  sqlite3_stmt* statement = nullptr;
  check(database_, sqlite3_prepare_v2(database_, sql.data(), static_cast<int>(sql.size()), &statement, nullptr));
  statement_.reset(statement);
}

void Statement::bind(int parameter, std::string_view text) {
  check(database_, sqlite3_bind_text(statement_.get(), parameter + 1, text.data(), static_cast<int>(text.size()),
                                     SQLITE_TRANSIENT));
}

void Statement::bind(int parameter, const std::optional<double>& value) {
  check(database_, value ? sqlite3_bind_double(statement_.get(), parameter + 1, *value)
                         : sqlite3_bind_null(statement_.get(), parameter + 1));
}

bool Statement::step() {
  const int result = sqlite3_step(statement_.get());
  if (result == SQLITE_ROW) return true;
  check(database_, sqlite3_reset(statement_.get()));
  return false;
}

std::string Statement::text(int column) const {
  const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(statement_.get(), column));
  return text == nullptr ? ""
                         : std::string(text, static_cast<std::size_t>(sqlite3_column_bytes(statement_.get(), column)));
}

std::optional<double> Statement::number(int column) const {
  if (sqlite3_column_type(statement_.get(), column) == SQLITE_NULL) return std::nullopt;
  return sqlite3_column_double(statement_.get(), column);
}

Database::Database(const std::filesystem::path& file, Open open) {
  sqlite3* database = nullptr;
  const int flags = open == Open::read ? SQLITE_OPEN_READONLY : SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE;
  const int result = sqlite3_open_v2(file.c_str(), &database, flags, nullptr);
  database_.reset(database);
  if (result != SQLITE_OK)
    throw files::BadInput(file.string(), 1, "cannot be opened, expected a table that bms fleet merge has written");
}

void Database::run(const std::string& sql) {
  check(database_.get(), sqlite3_exec(database_.get(), sql.c_str(), nullptr, nullptr, nullptr));
}

}  // namespace bms::fleet
