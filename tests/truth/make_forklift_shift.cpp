// Writes evidence/recordings/forklift_shift.csv, or the file named.
#include <cstdio>
#include <fstream>

#include "tests/truth/forklift_shift.hpp"

int main(int count, char** arguments) {
  const char* path = count > 1 ? arguments[1] : BMS_SOURCE_DIR "/evidence/recordings/forklift_shift.csv";
  std::ofstream file(path, std::ios::binary);
  file << bms::plant::forklift_shift_csv();
  file.close();
  if (file) return 0;
  std::fprintf(stderr, "%s: cannot be written\n", path);
  return 1;
}
