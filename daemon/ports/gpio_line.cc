#include "daemon/ports/gpio_line.h"

#include <fcntl.h>
#include <linux/gpio.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

namespace focalfleet {
namespace {

constexpr char kConsumer[] = "focalfleetd SYNC";
static_assert(sizeof kConsumer <= GPIO_MAX_NAME_SIZE);

class Kernel : public GpioKernel {
 public:
  int Open(const char* path) override { return ::open(path, O_RDWR | O_CLOEXEC); }
  int Control(int fd, unsigned long request, void* argument) override {
    return ::ioctl(fd, request, argument);
  }
  void Close(int fd) override { ::close(fd); }
};

/// Owns the chip's descriptor within a scope; -1: none.
class OpenChip {
 public:
  OpenChip(GpioKernel& kernel, const std::string& path)
      : kernel_(kernel), fd_(kernel.Open(path.c_str())) {}
  OpenChip(const OpenChip&) = delete;
  OpenChip& operator=(const OpenChip&) = delete;
  ~OpenChip() {
    if (fd_ >= 0) kernel_.Close(fd_);
  }
  [[nodiscard]] int fd() const { return fd_; }

 private:
  GpioKernel& kernel_;
  int fd_;
};

/// The text of a field that the kernel fills without a promise to end it by NUL.
template <std::size_t kSize>
std::string TextOf(const char (&field)[kSize]) {
  return {field, ::strnlen(field, kSize)};
}

Status CheckLine(const GpioLineOptions& options, GpioKernel& kernel, int chip) {
  const auto fails = [&](const std::string& why) {
    return Fail(ErrorCode::kUnavailable, options.chip + ": " + why);
  };
  gpiochip_info info{};
  if (kernel.Control(chip, GPIO_GET_CHIPINFO_IOCTL, &info) < 0)
    return fails(std::string("is no GPIO chip: ") + std::strerror(errno));
  if (options.line >= info.lines)
    return fails("has no line " + std::to_string(options.line) + ": " + TextOf(info.label) +
                 " has " + std::to_string(info.lines) + " lines, counted from 0");
  gpio_v2_line_info line{};
  line.offset = options.line;
  if (kernel.Control(chip, GPIO_V2_GET_LINEINFO_IOCTL, &line) < 0)
    return fails("line " + std::to_string(options.line) +
                 " cannot be asked: " + std::strerror(errno));
  if ((line.flags & GPIO_V2_LINE_FLAG_USED) != 0) {
    const std::string consumer = TextOf(line.consumer);
    return fails("line " + std::to_string(options.line) + " is in use" +
                 (consumer.empty() ? "" : " by '" + consumer + "'"));
  }
  return {};
}

}  // namespace

GpioKernel& RealGpioKernel() {
  static Kernel kernel;
  return kernel;
}

Result<std::unique_ptr<SyncLine>> GpioLine::Create(const GpioLineOptions& options,
                                                   GpioKernel& kernel) {
  const OpenChip chip(kernel, options.chip);
  if (chip.fd() < 0)
    return Fail(ErrorCode::kUnavailable, options.chip + ": " + std::strerror(errno));
  FOCALFLEET_TRY(CheckLine(options, kernel, chip.fd()));
  gpio_v2_line_request request{};
  request.offsets[0] = options.line;
  request.num_lines = 1;
  request.config.flags = GPIO_V2_LINE_FLAG_OUTPUT;
  if (options.active_low) request.config.flags |= GPIO_V2_LINE_FLAG_ACTIVE_LOW;
  // The line is at rest from the first moment on: units may be armed by an earlier run.
  request.config.num_attrs = 1;
  request.config.attrs[0].mask = 1;
  request.config.attrs[0].attr.id = GPIO_V2_LINE_ATTR_ID_OUTPUT_VALUES;
  request.config.attrs[0].attr.values = 0;
  std::memcpy(request.consumer, kConsumer, sizeof kConsumer);
  if (kernel.Control(chip.fd(), GPIO_V2_GET_LINE_IOCTL, &request) < 0)
    return Fail(ErrorCode::kUnavailable, options.chip + ": line " + std::to_string(options.line) +
                                             " cannot be an output: " + std::strerror(errno));
  return std::unique_ptr<SyncLine>(
      new GpioLine(&kernel, request.fd, options.chip + " line " + std::to_string(options.line)));
}

GpioLine::~GpioLine() { kernel_.Close(fd_); }

Status GpioLine::Set(bool active) {
  gpio_v2_line_values values{};
  values.mask = 1;
  values.bits = active ? 1 : 0;
  if (kernel_.Control(fd_, GPIO_V2_LINE_SET_VALUES_IOCTL, &values) == 0) return {};
  return Fail(ErrorCode::kUnavailable, name_ + ": " + std::strerror(errno));
}

}  // namespace focalfleet
