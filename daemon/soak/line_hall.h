// LineHall is the server of lines of a simulated daemon. Clients outside put lines in and take
// answers out; no socket is between them. As with the real one, a stop goes before all other lines.
#pragma once

#include <deque>
#include <functional>
#include <string>
#include <string_view>
#include <utility>

#include "daemon/control/line_exchange.h"

namespace focalfleet::soak {

class LineHall final : public LineExchange {
 public:
  struct Hooks {
    std::function<bool(std::string_view)> urgent;
    /// An answer, or a line before it (`last` is false). False: the client is gone.
    std::function<bool(ClientId, std::string_view, bool last)> out;
  };
  explicit LineHall(Hooks hooks) : hooks_(std::move(hooks)) {}

  void Put(ClientId client, std::string line) {
    lines_.push_back(
        {.client = client, .text = std::move(line), .caller = {.role = Role::kEngineer}});
  }
  [[nodiscard]] bool waits() const { return !lines_.empty(); }

  [[nodiscard]] int fd() const override { return -1; }
  void Service(std::vector<IncomingLine>* urgent) override {
    bool overtakes = false;
    for (auto line = lines_.begin(); line != lines_.end();) {
      if (!hooks_.urgent(line->text)) {
        ++line;
        continue;
      }
      urgent->push_back(std::move(*line));
      line = lines_.erase(line);
      overtakes = true;
    }
    for (IncomingLine& line : lines_) line.overtaken = line.overtaken || overtakes;
  }
  std::optional<IncomingLine> Next() override {
    if (lines_.empty()) return std::nullopt;
    IncomingLine line = std::move(lines_.front());
    lines_.pop_front();
    return line;
  }
  [[nodiscard]] bool connected(ClientId /*client*/) const override { return true; }
  bool Answer(ClientId client, std::string_view line) override {
    return hooks_.out(client, line, true);
  }
  bool Progress(ClientId client, std::string_view line) override {
    return hooks_.out(client, line, false);
  }

 private:
  Hooks hooks_;
  std::deque<IncomingLine> lines_;
};

}  // namespace focalfleet::soak
