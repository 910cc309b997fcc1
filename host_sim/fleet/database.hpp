// SQLite with exceptions.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

struct sqlite3;
struct sqlite3_stmt;

namespace bms::fleet {

class Database;

/// A prepared statement. Parameters and columns are numbered from 0.
class Statement {
 public:
  Statement(Database& database, std::string_view sql);
  void bind(int parameter, std::string_view text);
  void bind(int parameter, const std::optional<double>& value);  ///< nothing: NULL
  /// Returns true if there is a row. After the last row the statement can be bound and run again.
  bool step();
  std::string text(int column) const;
  std::optional<double> number(int column) const;

 private:
  struct Finalize {
    void operator()(sqlite3_stmt* statement) const;
  };
  sqlite3* database_;
  std::unique_ptr<sqlite3_stmt, Finalize> statement_;
};

class Database {
 public:
  enum class Open { read, create };
  /// Throws BadInput if the file cannot be opened or is not a database.
  Database(const std::filesystem::path& file, Open open);
  /// Runs statements without results.
  void run(const std::string& sql);
  sqlite3* handle() const { return database_.get(); }

 private:
  struct Close {
    void operator()(sqlite3* database) const;
  };
  std::unique_ptr<sqlite3, Close> database_;
};

}  // namespace bms::fleet
