// fits_copy IN OUT reads a table and writes it again, to be compared by another FITS library.
#include <cstdio>

#include "daemon/files/fits_table.h"

int main(int count, char** arguments) {
  if (count != 3) return 2;
  const auto table = focalfleet::ReadFitsTable(arguments[1]);
  const auto written = table ? focalfleet::WriteFitsTable(arguments[2], *table)
                             : focalfleet::Status(tl::unexpected(table.error()));
  if (!written) std::fprintf(stderr, "%s\n", written.error().text.c_str());
  return written ? 0 : 1;
}
