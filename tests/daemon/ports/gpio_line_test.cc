#include "daemon/ports/gpio_line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/gpio.h>

#include <cerrno>
#include <cstring>
#include <vector>

namespace focalfleet {
namespace {

using ::testing::HasSubstr;

/// The chip of four lines stands in for the kernel's calls. The test does not show how a real
/// driver treats these calls.
class ChipBehindTheDoor : public GpioKernel {
 public:
  int Open(const char* path) override {
    if (std::string(path) != "/dev/gpiochip7") return Refuse(ENOENT);
    ++open;
    return kChip;
  }
  int Control(int fd, unsigned long request, void* argument) override {
    if (fd == kLine && request == GPIO_V2_LINE_SET_VALUES_IOCTL) {
      if (dead) return Refuse(EIO);
      levels.push_back((static_cast<gpio_v2_line_values*>(argument)->bits & 1) != 0);
      return 0;
    }
    if (fd != kChip || no_chip) return Refuse(ENOTTY);
    if (request == GPIO_GET_CHIPINFO_IOCTL) {
      auto* info = static_cast<gpiochip_info*>(argument);
      std::strcpy(info->label, "plate");
      info->lines = 4;
      return 0;
    }
    if (request == GPIO_V2_GET_LINEINFO_IOCTL) {
      auto* line = static_cast<gpio_v2_line_info*>(argument);
      if (line->offset != 2) return 0;
      line->flags = GPIO_V2_LINE_FLAG_USED;
      std::strcpy(line->consumer, "shutter");
      return 0;
    }
    if (request != GPIO_V2_GET_LINE_IOCTL) return Refuse(EINVAL);
    taken = *static_cast<gpio_v2_line_request*>(argument);
    static_cast<gpio_v2_line_request*>(argument)->fd = kLine;
    ++open;
    return 0;
  }
  void Close(int fd) override {
    if (fd >= 0) --open;
  }

  static constexpr int kChip = 30;
  static constexpr int kLine = 31;
  int open = 0;
  bool no_chip = false;
  bool dead = false;
  gpio_v2_line_request taken{};
  std::vector<bool> levels;

 private:
  static int Refuse(int why) {
    errno = why;
    return -1;
  }
};

TEST(GpioLine, IsTakenAtRestAndSetByTheKernel) {
  ChipBehindTheDoor chip;
  {
    auto line = GpioLine::Create({.chip = "/dev/gpiochip7", .line = 1, .active_low = true}, chip);
    ASSERT_TRUE(line) << line.error().text;
    EXPECT_EQ((*line)->name(), "/dev/gpiochip7 line 1");
    EXPECT_EQ(chip.open, 1) << "the chip is given back";
    EXPECT_EQ(chip.taken.num_lines, 1u);
    EXPECT_EQ(chip.taken.offsets[0], 1u);
    EXPECT_EQ(chip.taken.config.flags, GPIO_V2_LINE_FLAG_OUTPUT | GPIO_V2_LINE_FLAG_ACTIVE_LOW);
    ASSERT_EQ(chip.taken.config.num_attrs, 1u);
    EXPECT_EQ(chip.taken.config.attrs[0].attr.id, GPIO_V2_LINE_ATTR_ID_OUTPUT_VALUES);
    EXPECT_EQ(chip.taken.config.attrs[0].attr.values, 0u);
    ASSERT_TRUE((*line)->Set(true));
    ASSERT_TRUE((*line)->Set(false));
    chip.dead = true;
    const Status done = (*line)->Set(true);
    ASSERT_FALSE(done);
    EXPECT_THAT(done.error().text, HasSubstr("/dev/gpiochip7 line 1"));
  }
  EXPECT_EQ(chip.levels, (std::vector<bool>{true, false}));
  EXPECT_EQ(chip.open, 0);
}

TEST(GpioLine, SaysWhatIsNotThere) {
  ChipBehindTheDoor chip;
  const auto why = [&](const char* path, std::uint32_t line) {
    const auto made = GpioLine::Create({.chip = path, .line = line, .active_low = false}, chip);
    EXPECT_FALSE(made);
    EXPECT_EQ(chip.open, 0);
    return made ? "" : made.error().text;
  };
  EXPECT_EQ(why("/dev/gpiochip9", 0), "/dev/gpiochip9: No such file or directory");
  EXPECT_EQ(why("/dev/gpiochip7", 4),
            "/dev/gpiochip7: has no line 4: plate has 4 lines, counted from 0");
  EXPECT_EQ(why("/dev/gpiochip7", 2), "/dev/gpiochip7: line 2 is in use by 'shutter'");
  chip.no_chip = true;
  EXPECT_THAT(why("/dev/gpiochip7", 0), HasSubstr("is no GPIO chip"));
}

TEST(GpioLine, TheRealKernelRefusesWhatIsNoChip) {
  const auto missing =
      GpioLine::Create({.chip = "/dev/gpiochip4711", .line = 0, .active_low = false});
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().text, "/dev/gpiochip4711: No such file or directory");
  const auto other = GpioLine::Create({.chip = "/dev/null", .line = 0, .active_low = false});
  ASSERT_FALSE(other);
  EXPECT_THAT(other.error().text, HasSubstr("/dev/null: is no GPIO chip"));
}

}  // namespace
}  // namespace focalfleet
