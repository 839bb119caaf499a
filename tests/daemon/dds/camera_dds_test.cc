// A client in C, which knows only the shipped IDL, plays a camera that speaks DDS.
#include "daemon/camera/camera_dds.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "tests/daemon/dds/client_process.h"
#include "tests/daemon/dds/own_domain.h"
#include "tests/daemon/dds/taken_ports.h"

namespace focalfleet {
namespace {

using test::ClientProcess;
using test::OwnDomain;
using ::testing::HasSubstr;

constexpr SensorLimits kSensor{1000, 1000};
constexpr std::int64_t kSinceNs = 1'795'316'645'678'000'000;

class CameraDdsTest : public ::testing::Test {
 protected:
  void Start(const std::vector<std::string>& words) {
    if (port_ == nullptr)
      port_ = std::make_unique<CameraDds>(
          CameraDds::Options{.dds = {.domain = OwnDomain(), .config_xml = {}}, .sensor = kSensor});
    std::vector<std::string> command{"/usr/bin/env", "CYCLONEDDS_URI=" LOOPBACK_URI, SPOT_SENDER,
                                     std::to_string(OwnDomain())};
    command.insert(command.end(), words.begin(), words.end());
    sender_ = std::make_unique<ClientProcess>(std::move(command));
    ASSERT_EQ(sender_->Line(), "ready");
  }

  /// Sends a request and takes until an exposure comes. An empty optional means that none came.
  Result<std::optional<Exposure>> Ask(std::uint64_t id) {
    EXPECT_TRUE(port_->Request(id, {kSinceNs + static_cast<std::int64_t>(id)}));
    const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    for (;;) {
      auto taken = port_->Take();
      if (!taken || *taken || std::chrono::steady_clock::now() > until) return taken;
      std::this_thread::yield();
    }
  }

  std::unique_ptr<CameraDds> port_;
  std::unique_ptr<ClientProcess> sender_;
};

TEST_F(CameraDdsTest, AsksAndTakesWhatTheCameraSaw) {
  Start({"good", "many"});
  const auto three = Ask(12);
  ASSERT_TRUE(three) << three.error().text;
  ASSERT_TRUE(*three);
  EXPECT_EQ((*three)->id, "good-12");
  EXPECT_EQ((*three)->taken_unix_ns, kSinceNs + 12 + 1'000'000);
  ASSERT_EQ((*three)->spots.size(), 3u);
  EXPECT_EQ((*three)->spots[2].id, 3u);
  EXPECT_EQ((*three)->spots[2].x_px, 12.5);
  EXPECT_EQ((*three)->spots[2].y_px, 20.25);
  EXPECT_EQ((*three)->spots[2].flux, 3);
  EXPECT_EQ((*three)->spots[2].fwhm_px, 2);
  const auto many = Ask(13);
  ASSERT_TRUE(many) << many.error().text;
  ASSERT_TRUE(*many);
  EXPECT_EQ((*many)->spots.size(), 5000u);
  EXPECT_EQ(sender_->Finish(), 0);
}

TEST_F(CameraDdsTest, WhatIsNoExposureIsRefusedAndTheNextIsTaken) {
  Start({"nan", "off", "dark", "twice", "nameless", "good"});
  std::uint64_t id = 0;
  for (const char* reason :
       {"spot 2: its place is not finite", "spot 2: it is off the sensor",
        "spot 2: its flux is not above 0", "spot 1 is there twice", "exposure_id is empty"}) {
    const auto refused = Ask(++id);
    ASSERT_FALSE(refused) << reason;
    EXPECT_EQ(refused.error().code, ErrorCode::kInvalid);
    EXPECT_THAT(refused.error().text, HasSubstr(reason));
    EXPECT_THAT(refused.error().text, HasSubstr("focalfleet/exposure"));
  }
  const auto good = Ask(++id);
  ASSERT_TRUE(good) << good.error().text;
  EXPECT_EQ((*good)->id, "good-6");
}

TEST_F(CameraDdsTest, NothingComesWhereNobodyAnswers) {
  CameraDds port({.dds = {.domain = OwnDomain(), .config_xml = {}}, .sensor = kSensor});
  ASSERT_TRUE(port.Request(1, {kSinceNs}));
  const auto nothing = port.Take();
  ASSERT_TRUE(nothing);
  EXPECT_FALSE(*nothing);
}

TEST_F(CameraDdsTest, WithoutAFreePortItSaysSoAndJoinsByItselfWhenThereIsOne) {
  auto taken = std::make_unique<test::TakenPorts>(OwnDomain());
  std::mutex mutex;
  std::vector<std::string> reported;
  port_ = std::make_unique<CameraDds>(
      CameraDds::Options{.dds = {.domain = OwnDomain(), .config_xml = {}},
                         .sensor = kSensor,
                         .tell =
                             [&](const std::string& text) {
                               const std::lock_guard lock(mutex);
                               reported.push_back(text);
                             },
                         .rejoin_period = std::chrono::milliseconds(10)});
  const auto asked = port_->Request(1, {kSinceNs});
  ASSERT_FALSE(asked);
  EXPECT_EQ(asked.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(asked.error().text, HasSubstr("the DDS domain is not joined yet"));
  const auto nothing = port_->Take();
  EXPECT_TRUE(nothing && !*nothing);
  taken.reset();
  Start({"good"});  // a camera is ready when a reader listens
  const auto good = Ask(2);
  ASSERT_TRUE(good) << good.error().text;
  ASSERT_TRUE(*good);
  EXPECT_EQ((*good)->id, "good-2");
  const std::lock_guard lock(mutex);
  ASSERT_EQ(reported.size(), 2u);
  EXPECT_THAT(reported[0], HasSubstr("DDS: cannot"));
  EXPECT_EQ(reported[1], "");
}

}  // namespace
}  // namespace focalfleet
