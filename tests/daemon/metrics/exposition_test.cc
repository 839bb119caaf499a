#include "daemon/metrics/exposition.h"

#include <gtest/gtest.h>

#include <limits>

namespace focalfleet {
namespace {

TEST(Exposition, WritesFamiliesAsTheFormatAsks) {
  Exposition out;
  out.Gauge("a_meters", "A length.", 0.5);
  out.Counter("b_total", "A count.", 3);
  out.BeginGauge("c", "Several.");
  out.Sample("bus", 7, -1);
  out.Sample("state", "up", 1);
  out.SampleOf("x=\"1\",y=\"2\"", 1e-9);
  EXPECT_EQ(out.text(),
            "# HELP a_meters A length.\n# TYPE a_meters gauge\na_meters 0.5\n"
            "# HELP b_total A count.\n# TYPE b_total counter\nb_total 3\n"
            "# HELP c Several.\n# TYPE c gauge\nc{bus=\"7\"} -1\nc{state=\"up\"} 1\n"
            "c{x=\"1\",y=\"2\"} 1e-09\n");
}

TEST(Exposition, WritesNumbersThatAreNone) {
  Exposition out;
  out.Gauge("a", "x", std::numeric_limits<double>::infinity());
  out.Gauge("b", "x", -std::numeric_limits<double>::infinity());
  out.Gauge("c", "x", std::numeric_limits<double>::quiet_NaN());
  EXPECT_NE(out.text().find("\na +Inf\n"), std::string::npos);
  EXPECT_NE(out.text().find("\nb -Inf\n"), std::string::npos);
  EXPECT_NE(out.text().find("\nc NaN\n"), std::string::npos);
}

TEST(Exposition, EscapesLabels) { EXPECT_EQ(EscapedLabel("a\\b\"c\nd"), "a\\\\b\\\"c\\nd"); }

TEST(Exposition, BucketsOfAHistogramAreCumulative) {
  constexpr double kBounds[] = {1, 10};
  Histogram histogram(kBounds);
  for (const double value : {0.5, 1.0, 1.5, 10.0, 11.0, 12.0}) histogram.Observe(value);
  Exposition out;
  out.Write("h", "x", histogram.Read());
  EXPECT_EQ(out.text(),
            "# HELP h x\n# TYPE h histogram\nh_bucket{le=\"1\"} 2\nh_bucket{le=\"10\"} 4\n"
            "h_bucket{le=\"+Inf\"} 6\nh_sum 36\nh_count 6\n");
}

}  // namespace
}  // namespace focalfleet
