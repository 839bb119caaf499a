// GpioLine drives the SYNC line as an output of a GPIO character device, by version 2 of the
// kernel's interface (linux/gpio.h, since Linux 5.10). Opening reserves the line and sets it to
// rest. No other program can use the line until it is released.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "daemon/ports/sync_line.h"

namespace focalfleet {

/// The system calls that the line needs; a test supplies its own chip behind them.
class GpioKernel {
 public:
  GpioKernel() = default;
  GpioKernel(const GpioKernel&) = delete;
  GpioKernel& operator=(const GpioKernel&) = delete;
  virtual ~GpioKernel() = default;

  /// As open(2), ioctl(2), close(2): -1 and errno on failure.
  virtual int Open(const char* path) = 0;
  virtual int Control(int fd, unsigned long request, void* argument) = 0;
  virtual void Close(int fd) = 0;
};
GpioKernel& RealGpioKernel();

struct GpioLineOptions {
  std::string chip;  // /dev/gpiochip0
  std::uint32_t line = 0;
  bool active_low = false;
};

class GpioLine : public SyncLine {
 public:
  /// Reserves the line, at rest. `kernel` outlives the line.
  /// Errors: kUnavailable: there is no such chip or line, it is no GPIO chip, or the line is in
  /// use; the text states the reason.
  static Result<std::unique_ptr<SyncLine>> Create(const GpioLineOptions& options,
                                                  GpioKernel& kernel = RealGpioKernel());
  ~GpioLine() override;

  Status Set(bool active) override;
  [[nodiscard]] const std::string& name() const override { return name_; }

 private:
  GpioLine(GpioKernel* kernel, int fd, std::string name)
      : kernel_(*kernel), fd_(fd), name_(std::move(name)) {}

  GpioKernel& kernel_;
  int fd_;  // of the line
  std::string name_;
};

}  // namespace focalfleet
