#include "daemon/verbs/store_questions.h"

#include <exception>
#include <string>

namespace focalfleet {

StoreAnswer StoreQuestions::operator()(const StoreQuestion& question,
                                       const std::atomic<bool>& ending) {
  const auto read = [&]() -> Result<Json> {
    if (reader_ == nullptr) {
      FOCALFLEET_TRY_ASSIGN(reader_, StoreReader::Open(path_, options_));
      reader_->EndWith(&ending);
    }
    return question.read(reader_.get());
  };
  Result<Json> answer;
  try {
    answer = read();
  } catch (const std::exception& error) {  // memory ended: the question fails, not the daemon
    answer = Fail(ErrorCode::kUnavailable, std::string("the question failed: ") + error.what());
  }
  return {question.number, answer ? EncodeResult(question.request, *answer)
                                  : EncodeError(question.request, answer.error())};
}

}  // namespace focalfleet
