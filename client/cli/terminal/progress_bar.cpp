#include "client/cli/terminal/progress_bar.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace voxeld::cli {
namespace {

constexpr auto kPause = std::chrono::milliseconds(50);
constexpr int kBarColumns = 30;

}  // namespace

ProgressBar::ProgressBar(bool quiet) : is_on_(!quiet && isatty(STDERR_FILENO) == 1) {}

ProgressBar::~ProgressBar() {
  clear();
}

void ProgressBar::show(const client::Progress& progress) {
  if (!is_on_) return;
  const auto now = std::chrono::steady_clock::now();
  if (is_drawn_ && progress.stage == stage_ && now - last_ < kPause) return;
  last_ = now;
  stage_ = progress.stage;
  is_drawn_ = true;
  if (progress.total <= 0) {
    std::fprintf(stderr, "\r\033[K%-10s", stage_.c_str());
    return;
  }
  const double part = std::clamp(
      static_cast<double>(progress.done) / static_cast<double>(progress.total), 0.0, 1.0);
  const int filled = static_cast<int>(part * kBarColumns);
  const std::string bar = std::string(static_cast<size_t>(filled), '#') +
                          std::string(static_cast<size_t>(kBarColumns - filled), '.');
  if (progress.unit == "frames") {
    std::fprintf(stderr, "\r\033[K%-10s [%s] frame %lld of %lld", stage_.c_str(), bar.c_str(),
                 static_cast<long long>(progress.done), static_cast<long long>(progress.total));
    return;
  }
  std::fprintf(stderr, "\r\033[K%-10s [%s] %3.0f %%", stage_.c_str(), bar.c_str(), 100.0 * part);
}

void ProgressBar::clear() {
  if (is_drawn_) std::fputs("\r\033[K", stderr);
  is_drawn_ = false;
}

}  // namespace voxeld::cli
