#include "daemon/control/messages.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;

TEST(ControlMessages, RequestSurvivesTheWay) {
  const ControlRequest sent{7, "apply", {{"source", "a.csv"}, {"wait", true}}};
  const auto received = DecodeRequest(EncodeRequest(sent));
  ASSERT_TRUE(received);
  EXPECT_EQ(received->id, 7u);
  EXPECT_EQ(received->verb, "apply");
  EXPECT_EQ(received->args, sent.args);
}

TEST(ControlMessages, AnswersSurviveTheWay) {
  const auto progress = DecodeAnswer(EncodeProgress(3, {{"round", 1}}));
  ASSERT_TRUE(progress);
  EXPECT_EQ(progress->kind, ControlAnswer::Kind::kProgress);
  EXPECT_EQ(progress->body["round"], 1);
  const auto result = DecodeAnswer(EncodeResult(3, Json::array({1, 2})));
  ASSERT_TRUE(result);
  EXPECT_EQ(result->kind, ControlAnswer::Kind::kResult);
  EXPECT_EQ(result->body.size(), 2u);
}

TEST(ControlMessages, EveryErrorCodeSurvivesTheWay) {
  for (const auto code : {ErrorCode::kInvalid, ErrorCode::kRefused, ErrorCode::kUnavailable,
                          ErrorCode::kFull, ErrorCode::kNewer}) {
    const auto answer = DecodeAnswer(EncodeError(1, {code, "why"}));
    ASSERT_TRUE(answer);
    EXPECT_EQ(answer->kind, ControlAnswer::Kind::kError);
    EXPECT_EQ(answer->error.code, code);
    EXPECT_EQ(answer->error.text, "why");
  }
}

TEST(ControlMessages, AnythingMalformedIsAnErrorNotACrash) {
  const std::string deep(100'000, '[');
  for (const std::string& line :
       {std::string(), std::string("{"), std::string("[]"), std::string("null"), std::string("{}"),
        std::string(R"({"id":-1,"verb":"x"})"), std::string(R"({"id":"1","verb":"x"})"),
        std::string(R"({"id":1})"), std::string(R"({"id":1,"verb":2})"),
        std::string(R"({"id":1,"verb":"x","args":[]})"), std::string("\xff\xfe\0\x01", 4), deep}) {
    const auto request = DecodeRequest(line);
    ASSERT_FALSE(request) << line.substr(0, 40);
    EXPECT_EQ(request.error().code, ErrorCode::kInvalid);
    EXPECT_FALSE(DecodeAnswer(line));
  }
}

TEST(ControlMessages, DepthIsBoundedBeforeAnythingIsParsed) {
  const auto nested = [](std::size_t depth) {
    return R"({"id":1,"verb":"x","args":{"a":)" + std::string(depth, '[') +
           std::string(depth, ']') + "}}";
  };
  EXPECT_TRUE(DecodeRequest(nested(limits::kControlDepth - 2)));
  for (const std::string& line :
       {nested(limits::kControlDepth - 1), nested(1'000'000), std::string(2'000'000, '[')}) {
    const auto request = DecodeRequest(line);
    ASSERT_FALSE(request);
    EXPECT_THAT(request.error().text, HasSubstr("more than 16 deep"));
    EXPECT_FALSE(DecodeAnswer(line));
  }
}

TEST(ControlMessages, OnlyAModelMayBeLongerThanOtherLines) {
  const std::string text(limits::kControlLineBytes, 't');
  const auto load = DecodeRequest(EncodeRequest({1, "model_load", {{"model_toml", text}}}));
  ASSERT_TRUE(load) << load.error().text;
  EXPECT_TRUE(
      DecodeRequest(R"({"id":1,"verb":"model_load","args":{"model_toml":")" + text + R"("}})"));
  const auto apply = DecodeRequest(EncodeRequest({1, "apply", {{"targets_csv", text}}}));
  ASSERT_FALSE(apply);
  EXPECT_THAT(apply.error().text, HasSubstr("more than 2097152 bytes"));
  EXPECT_TRUE(DecodeRequest(EncodeRequest({1, "apply", {{"targets_csv", text.substr(100)}}})));
}

TEST(ControlMessages, AProgressForManyIsThatForOne) {
  const Json progress{{"state", "moving"}, {"share", 0.5}};
  EXPECT_EQ(ProgressLine(7, EncodeText(progress)),
            R"({"id":7,"progress":)" + progress.dump() + "}");
  EXPECT_EQ(EncodeProgress(7, progress), ProgressLine(7, EncodeText(progress)));
  const auto answer = DecodeAnswer(EncodeProgress(7, progress));
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->body, progress);
}

TEST(ControlMessages, BracketsAndEscapedQuotesInTextsAreNoDepth) {
  const std::string brackets(100, '[');
  const ControlRequest sent{1, "x", {{"a", brackets + "\"" + brackets + "\\"}}};
  const auto received = DecodeRequest(EncodeRequest(sent));
  ASSERT_TRUE(received) << received.error().text;
  EXPECT_EQ(received->args, sent.args);
}

TEST(ControlMessages, TheNumberOfValuesOfARequestIsBounded) {
  const auto list = [](std::size_t count) {
    std::string line = R"({"id":1,"verb":"x","args":{"a":[1)";
    for (std::size_t i = 1; i < count; ++i) line += ",1";
    return line + "]}}";
  };
  EXPECT_TRUE(DecodeRequest(list(limits::kUnits)));
  const auto many = DecodeRequest(list(limits::kControlValues + 1));
  ASSERT_FALSE(many);
  EXPECT_THAT(many.error().text, HasSubstr("more than 65536 values"));
  EXPECT_FALSE(DecodeRequest(R"({"id":1,"verb":"x","args":{"a":[)" +
                             std::string(2 * limits::kControlValues, '[')));
}

TEST(ControlMessages, TextsAreBounded) {
  const auto verb = DecodeRequest(R"({"id":1,"verb":")" + std::string(100, 'v') + "\"}");
  ASSERT_FALSE(verb);
  EXPECT_THAT(verb.error().text, HasSubstr("'verb' has more than 32 bytes"));
  const Json args = {{"reason", std::string(256, 'r')}};
  const auto reason = TextArgument(args, "reason");
  ASSERT_FALSE(reason);
  EXPECT_EQ(reason.error().text, "argument 'reason' has 256 bytes, at most 255 are taken");
  EXPECT_FALSE(TextArgumentOr(args, "reason", ""));
  EXPECT_TRUE(TextArgument(args, "reason", 256));
  EXPECT_TRUE(TextArgument({{"reason", std::string(255, 'r')}}, "reason"));
}

TEST(ControlMessages, TextThatIsNotUtf8AndNumbersThatAreNoneStillMakeALine) {
  const std::string line = EncodeResult(1, {{"text", "\xff"}, {"x", std::nan("")}});
  const auto answer = DecodeAnswer(line);
  ASSERT_TRUE(answer);
  EXPECT_TRUE(answer->body["x"].is_null());
}

TEST(ControlMessages, ArgumentsAreCheckedByTypeAndRange) {
  const Json args = {{"u", 3},
                     {"neg", -3},
                     {"text", "t"},
                     {"flag", true},
                     {"real", 1.5},
                     {"list", {1, 2}},
                     {"bad", {1, 5'000'000'000}}};
  EXPECT_EQ(UnsignedArgument(args, "u").value(), 3u);
  EXPECT_EQ(IntegerArgument(args, "neg").value(), -3);
  EXPECT_EQ(TextArgument(args, "text").value(), "t");
  EXPECT_TRUE(FlagArgumentOr(args, "flag", false).value());
  EXPECT_FALSE(FlagArgumentOr(args, "absent", false).value());
  EXPECT_EQ(UnsignedArgumentOr(args, "absent", 9).value(), 9u);
  EXPECT_EQ(UnsignedListArgument(args, "list").value().size(), 2u);
  EXPECT_FALSE(UnsignedArgument(args, "neg"));
  EXPECT_FALSE(UnsignedArgument(args, "real"));
  EXPECT_FALSE(UnsignedArgument(args, "absent"));
  EXPECT_FALSE(TextArgument(args, "u"));
  EXPECT_FALSE(TextArgumentOr(args, "u", ""));
  EXPECT_FALSE(FlagArgumentOr(args, "u", true));
  EXPECT_FALSE(UnsignedListArgument(args, "bad"));
  EXPECT_NE(UnsignedArgument(args, "neg").error().text.find("neg"), std::string::npos);
}

}  // namespace
}  // namespace focalfleet
