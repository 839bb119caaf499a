#include "daemon/usage/roff.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace focalfleet::usage {
namespace {

using ::testing::HasSubstr;

TEST(Roff, EscapesWhatRoffWouldRead) {
  Roff page({"ship-sail", 1, "ship 1.0", "ship manual"}, "go with the wind");
  EXPECT_THAT(page.text(), HasSubstr(".TH \"SHIP\\-SAIL\" 1 \"\" \"ship 1.0\" \"ship manual\"\n"));
  EXPECT_THAT(page.text(), HasSubstr("ship\\-sail \\- go with the wind\n"));
  page.Paragraph(".fits or a\\b");
  EXPECT_THAT(page.text(), HasSubstr("\n\\&.fits or a\\eb\n"));
  page.Paragraph("'quoted'");
  EXPECT_THAT(page.text(), HasSubstr("\n\\(aqquoted\\(aq\n"));
  page.Usage("ship sail --far", 2);
  EXPECT_THAT(page.text(), HasSubstr("\\fBship sail\\fR \\-\\-far\n"));
  page.Item("--knots", "N", "How fast.");
  EXPECT_THAT(page.text(), HasSubstr(".TP\n\\fB\\-\\-knots\\fR \\fIN\\fR\nHow fast.\n"));
  page.References("ship(1), ship-sail(1)");
  EXPECT_THAT(page.text(), HasSubstr("\n\\fBship\\fR(1), \\fBship\\-sail\\fR(1)\n"));
  page.Literal("one\n.two");
  EXPECT_THAT(page.text(), HasSubstr(".nf\none\n\\&.two\n.fi\n"));
}

}  // namespace
}  // namespace focalfleet::usage
