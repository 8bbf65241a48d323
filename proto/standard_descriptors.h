// Standard descriptors of a program that was started without them.
#pragma once

#include <fcntl.h>

#include <cerrno>

namespace voxeld {

// Takes the numbers of stdin, stdout and stderr that are closed, before a file or socket gets them
// and with it what is printed. Reading and writing them fail as if they were closed.
inline void keep_standard_descriptors() {
  for (int descriptor = 0; descriptor <= 2; ++descriptor) {
    if (::fcntl(descriptor, F_GETFD) >= 0 || errno != EBADF) continue;
    (void)::open("/dev/null", descriptor == 0 ? O_WRONLY : O_RDONLY);  // the lowest number
  }
}

}  // namespace voxeld
