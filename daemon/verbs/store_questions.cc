#include "daemon/verbs/store_questions.h"

namespace focalfleet {

StoreAnswer StoreQuestions::operator()(const StoreQuestion& question,
                                       const std::atomic<bool>& ending) {
  const auto answer = [&]() -> Result<Json> {
    if (reader_ == nullptr) {
      FOCALFLEET_TRY_ASSIGN(reader_, StoreReader::Open(path_));
      reader_->EndWith(&ending);
    }
    return question.read(reader_.get());
  }();
  return {question.number, answer ? EncodeResult(question.request, *answer)
                                  : EncodeError(question.request, answer.error())};
}

}  // namespace focalfleet
