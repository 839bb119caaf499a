#include "daemon/campaign/verdict_sentence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "daemon/campaign/cause_words.h"
#include "sim/campaigns/diagnosis/decide/decide.h"
#include "sim/campaigns/effects/registry.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

sim::CauseFound Backlash() {
  sim::CauseFound cause = sim::CauseNamed("backlash");
  cause.axis = "both";
  cause.all_units = true;
  cause.amplitude = 0.4;
  cause.amplitude_unit = "deg";
  cause.size_um = 53;
  return cause;
}

sim::Diagnosis Explained(std::vector<sim::CauseFound> causes) {
  sim::Diagnosis diagnosis;
  diagnosis.verdict = sim::Verdict::kExplained;
  diagnosis.causes = std::move(causes);
  diagnosis.units = 60;
  diagnosis.gain.rms_before_um = 54.2;
  diagnosis.gain.rms_after_um = 6.13;
  diagnosis.gain.noise_floor_um = 5.9;
  return diagnosis;
}

TEST(VerdictSentence, IsWhatAnOperatorWouldSay) {
  const VerdictText text = TextOf(Explained({Backlash()}));
  EXPECT_EQ(text.says(),
            "All units end 0.4 deg late whenever they reverse: backlash of both axes. Nothing else "
            "is wrong. With it in the model fibres end 6.1 um from their predicted places instead "
            "of 54.");
  EXPECT_EQ(
      text.numbers,
      "Sizes at the fibre: backlash of both axes 53.0 um. Held-out rms 54.2 um before, 6.1 um "
      "after; noise 5.9 um.");
}

TEST(VerdictSentence, HasTheProbabilityOfANameThatHasARival) {
  sim::CauseFound cause = Backlash();
  cause.candidates = {"backlash", "friction_windup"};
  cause.log_odds = {{"friction_windup", -sim::kTemperature * std::log(32)}};
  EXPECT_THAT(TextOf(Explained({cause})).says(),
              HasSubstr("backlash of both axes (97 %) or wind-up under friction (3 %)."));
}

TEST(VerdictSentence, HasTheProbabilityOfANameInDoubt) {
  sim::CauseFound cause = Backlash();
  cause.doubt = 0.05;
  EXPECT_THAT(TextOf(Explained({cause})).says(),
              HasSubstr("backlash of both axes (95 %). Nothing"));
}

TEST(VerdictSentence, NamesTheUnits) {
  sim::CauseFound cause = Backlash();
  cause.all_units = false;
  cause.axis = "phi";
  cause.units = {12};
  EXPECT_THAT(TextOf(Explained({cause})).says(),
              HasSubstr("Unit 12 ends 0.4 deg late whenever it reverses: backlash of phi."));
  cause.units = {12, 40, 7};
  EXPECT_THAT(TextOf(Explained({cause})).says(), HasSubstr("Units 12, 40 and 7 end 0.4 deg late"));
  cause.units = {1, 2, 3, 4, 5};
  EXPECT_THAT(TextOf(Explained({cause})).says(), HasSubstr("5 of 60 units end 0.4 deg late"));
}

TEST(VerdictSentence, SaysWhatNoCauseExplains) {
  sim::Diagnosis diagnosis = Explained({Backlash()});
  diagnosis.verdict = sim::Verdict::kUnknown;
  diagnosis.unknown = {{.covariate = "temperature_c", .channel = "x", .size_um = 12.34}};
  const std::string says = TextOf(diagnosis).says();
  EXPECT_THAT(says,
              HasSubstr("Something else is wrong by 12.3 um that no known cause explains: see "
                        "temperature_c."));
  EXPECT_THAT(says, Not(HasSubstr("Nothing else")));
}

TEST(VerdictSentence, SaysThatNothingIsWrong) {
  sim::Diagnosis diagnosis = Explained({});
  diagnosis.verdict = sim::Verdict::kConsistent;
  EXPECT_EQ(
      TextOf(diagnosis).says(),
      "Nothing is wrong: fibres end 6.1 um from their predicted places, which is their noise.");
  diagnosis.verdict = sim::Verdict::kInsufficient;
  diagnosis.insufficient = "a unit has three moves";
  EXPECT_EQ(VerdictSentence(diagnosis),
            "These data are not enough for a verdict: a unit has three moves.");
}

TEST(VerdictSentence, CountsWhatItLeavesOut) {
  const sim::CauseFound one = Backlash();
  EXPECT_THAT(TextOf(Explained({one, one, one, one, one})).says(),
              HasSubstr("2 more causes are smaller."));
}

TEST(CauseWords, AreThereForEveryEffect) {
  for (const sim::Effect& effect : sim::EffectLibrary()) {
    const CauseWords words = WordsFor(effect.cause);
    EXPECT_NE(words.does, WordsFor("never_heard_of").does) << effect.cause;
    for (const bool one : {false, true})
      EXPECT_EQ(Spoken(words.does, one, 1, "2 um").find_first_of("[]<>{}|"), std::string::npos)
          << words.does;
  }
}

TEST(CauseWords, ChooseBySignAndNumber) {
  const char* does = "[are|is] {} <long|short>";
  EXPECT_EQ(Spoken(does, false, 1, "2 um"), "are 2 um long");
  EXPECT_EQ(Spoken(does, true, -1, "2 um"), "is 2 um short");
  EXPECT_EQ(Spoken("[open", false, 1, ""), "open");
  EXPECT_EQ(WordsFor("never_heard_of").name, "never_heard_of");
}

TEST(CauseWords, SayAmplitudesAsPeopleDo) {
  EXPECT_EQ(SpokenAmplitude(0.4, "deg"), "0.4 deg");
  EXPECT_EQ(SpokenAmplitude(-0.0123, "deg"), "0.012 deg");
  EXPECT_EQ(SpokenAmplitude(123.4, "um"), "123 um");
  EXPECT_EQ(SpokenAmplitude(0.00234, "deg/deg"), "0.23 %");
  EXPECT_EQ(SpokenAmplitude(2.34e-5, "1/K"), "23 parts in a million a kelvin");
  EXPECT_EQ(SpokenAmplitude(0.05, "mm"), "50 um");
  EXPECT_EQ(SpokenAmplitude(0, "deg"), "0 deg");
  EXPECT_EQ(SpokenAmplitude(std::nan(""), "deg"), "an unknown amount");
}

}  // namespace
}  // namespace focalfleet
