// Trace writes a series as the path data of SVG, short however long the series. A plot is about 640
// pixel columns wide; a waveform has millions of points. Among the points that follow each other
// within one column only the first, the lowest, the highest and the last are kept. They are kept
// exactly where they lie. The path has at most 4 * 640 * 15 bytes = 38 kB when x only grows. The
// line looks the same, and no peak is lost, however narrow. A second dot on the same pixel is left
// out.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace focalfleet::report {

enum class Style {
  kLine,
  kDots,
  kSteps,  // y holds until the next x
};

/// A point in the drawing area, from its left upper corner, y downwards. Not finite: a gap.
struct Pixel {
  double x = 0;
  double y = 0;
};

class Trace {
 public:
  struct Options {
    Style style = Style::kLine;
    std::size_t points_expected = 0;  // up to 4 points a column are all kept
    double width_px = 640;
    double height_px = 240;
  };
  explicit Trace(const Options& options);

  void Add(Pixel pixel);

  /// The `d` of a path, to be stroked with round caps: a point between two gaps is a dot. Empty
  /// where no point was added.
  std::string Finish();

 private:
  struct Kept {
    Pixel pixel;
    std::size_t index = 0;  // in the run of one column
  };

  void AddDot(Pixel pixel);
  void EmitRun();
  void Emit(Pixel pixel);
  void EndPiece();

  Options options_;
  bool reduces_;
  std::string path_;
  std::vector<bool> dots_;  // already drawn, row by row

  std::size_t run_length_ = 0;
  double run_column_ = 0;
  Kept first_, lowest_, highest_, last_;

  std::size_t piece_length_ = 0;  // points emitted since the last gap
};

}  // namespace focalfleet::report
