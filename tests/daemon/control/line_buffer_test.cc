#include "daemon/control/line_buffer.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace focalfleet {
namespace {

bool IsStop(std::string_view line) { return line == "stop"; }

std::string Rest(LineBuffer* buffer) {
  std::string all;
  while (const auto line = buffer->Take()) all += line->text + (line->overtaken ? "! " : " ");
  return all;
}

TEST(LineBuffer, GivesWholeLinesInOrder) {
  LineBuffer buffer;
  buffer.Append("a\nb\nc");
  EXPECT_EQ(buffer.first_bytes(), 1u);
  EXPECT_EQ(Rest(&buffer), "a b ");
  EXPECT_FALSE(buffer.has_line());
  EXPECT_EQ(buffer.first_bytes(), 1u);
  buffer.Append("d\n");
  EXPECT_EQ(Rest(&buffer), "cd ");
}

TEST(LineBuffer, TakesAnUrgentLineFromBehindOthersAndMarksThose) {
  LineBuffer buffer;
  buffer.Append("a\nb\nstop\nc\n");
  EXPECT_EQ(buffer.TakeUrgent(IsStop), "stop");
  EXPECT_FALSE(buffer.TakeUrgent(IsStop));
  EXPECT_EQ(Rest(&buffer), "a! b! c ");
}

TEST(LineBuffer, FindsAnUrgentLineHoweverItsBytesCome) {
  const std::string sent = "a\nstop\nbb\nstop\nstopp\nc\n";
  for (std::size_t chunk = 1; chunk <= sent.size(); ++chunk) {
    LineBuffer buffer;
    int urgent = 0;
    for (std::size_t at = 0; at < sent.size(); at += chunk) {
      buffer.Append(sent.substr(at, chunk));
      while (buffer.TakeUrgent(IsStop)) ++urgent;
    }
    EXPECT_EQ(urgent, 2) << chunk;
    EXPECT_FALSE(buffer.unseen());
    EXPECT_EQ(Rest(&buffer), "a! bb! stopp c ") << chunk;
  }
}

TEST(LineBuffer, LooksAtABoundedPieceEachTime) {
  LineBuffer buffer;
  int asked = 0;
  const auto count = [&asked](std::string_view line) {
    ++asked;
    return line == "stop";
  };
  std::string many;
  for (int i = 0; i < 5000; ++i) many += "1234567\n";
  buffer.Append(many + "stop\n");
  EXPECT_FALSE(buffer.TakeUrgent(count));
  EXPECT_LE(asked, static_cast<int>(LineBuffer::kLookBytes / 8) + 1);
  EXPECT_TRUE(buffer.unseen());
  std::optional<std::string> urgent;
  for (int turn = 0; turn < 100 && !urgent; ++turn) urgent = buffer.TakeUrgent(count);
  EXPECT_EQ(urgent, "stop");
  EXPECT_EQ(asked, 5001) << "no line is looked at twice";
}

TEST(LineBuffer, OvertakesCompleteLinesOnly) {
  LineBuffer buffer;
  buffer.Append("a\nb");
  buffer.Overtake();
  buffer.Append("b\nc\n");
  EXPECT_EQ(Rest(&buffer), "a! bb c ");
}

}  // namespace
}  // namespace focalfleet
