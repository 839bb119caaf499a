#include "sim/campaigns/diagnosis/terms/step_rows.h"

#include <algorithm>
#include <span>

namespace focalfleet::sim {

StepRows::StepRows(const Fit& fit, std::size_t unit)
    : white_(Whiten(fit, unit)), geometry_(white_.y.size()), y_(white_.y) {
  for (Eigen::Index c = 0; c < white_.geometry.cols(); ++c) geometry_.Add(white_.geometry.col(c));
  geometry_.Remove(&y_);
  AddUp();
}

Eigen::VectorXd StepRows::Column(std::size_t axis, std::size_t move, bool stays) const {
  Eigen::VectorXd column = Eigen::VectorXd::Zero(y_.size());
  const std::size_t end = stays ? EndOfStep(white_.track, move) : move + 1;
  for (std::size_t k = 0; k < rows(); ++k) {
    if (white_.moves[k] < move || white_.moves[k] >= end) continue;
    for (std::size_t xy = 0; xy < 2; ++xy)
      column[static_cast<Eigen::Index>(2 * k + xy)] = white_.turn_um[4 * k + 2 * axis + xy];
  }
  white_.Apply(column.data());
  geometry_.Remove(&column);
  return column;
}

void StepRows::Take(const Eigen::VectorXd& column, double step_deg) {
  y_ -= step_deg * column;
  AddUp();
}

StepRows::Jump StepRows::JumpAt(std::size_t row, std::size_t either_side, double least) const {
  std::size_t begin = row - std::min(row, either_side);
  std::size_t end = std::min(rows(), row + either_side);
  // Rows of other histories tell nothing of this one.
  while (EndOfStep(white_.track, move(begin)) <= move(row - 1)) ++begin;
  while (EndOfStep(white_.track, move(row)) <= move(end - 1)) --end;
  const StepProducts all = sums_[end] - sums_[begin];
  Eigen::Matrix<double, kGeometryColumns, kGeometryColumns> gram =
      all.topLeftCorner<kGeometryColumns, kGeometryColumns>();
  // Share of each column's square, above rounding. Half and double of it find the same slips.
  constexpr double kDependent = 1e-9;
  gram.diagonal() += kDependent * gram.diagonal();
  gram.diagonal().array() += 1e-300;  // a column of zeros
  const auto solver = gram.ldlt();
  const Eigen::Matrix<double, kGeometryColumns, 1> level =
      solver.solve(all.block<kGeometryColumns, 1>(0, kGeometryColumns));
  const double square = all(kGeometryColumns, kGeometryColumns) -
                        level.dot(all.block<kGeometryColumns, 1>(0, kGeometryColumns));
  if (square / 2 <= least) return {};
  const auto at = static_cast<Eigen::Index>(2 * row);
  const auto size = static_cast<Eigen::Index>(2 * (end - row));
  const auto geometry = white_.geometry.middleRows(at, size);
  Jump jump;
  std::array<Eigen::VectorXd, 2> columns;
  Eigen::Matrix<double, kGeometryColumns, 2> with =
      Eigen::Matrix<double, kGeometryColumns, 2>::Zero();
  for (const std::size_t axis : {kTheta, kPhi}) {
    const auto c = static_cast<Eigen::Index>(axis);
    columns[axis] = Behind(axis, row, end);
    with.col(c).head(geometry.cols()) = geometry.transpose() * columns[axis];
    jump.b[axis] = columns[axis].dot(y_.segment(at, size)) - with.col(c).dot(level);
  }
  const Eigen::Matrix<double, kGeometryColumns, 2> solved = solver.solve(with);
  for (const std::size_t a : {kTheta, kPhi})
    for (const std::size_t b : {kTheta, kPhi})
      jump.g[a][b] =
          columns[a].dot(columns[b]) -
          with.col(static_cast<Eigen::Index>(a)).dot(solved.col(static_cast<Eigen::Index>(b)));
  return jump;
}

std::size_t StepRows::MoveAfterRow(std::size_t row) const {
  const std::vector<char>& closed = track().facts->closed;
  const auto undoes_steps = [&](std::size_t one) {
    return track().restarts[one] != 0 || (!closed.empty() && closed[track().first_row + one] != 0);
  };
  const std::size_t earliest = row == 0 ? 0 : move(row - 1) + 1;
  std::size_t first = move(row);
  while (first > earliest && !undoes_steps(first)) --first;
  return first;
}

std::size_t StepRows::RowThatShows(std::size_t axis, std::size_t row) const {
  const double turn_deg = 360 / white_.track.unit->gear[axis];
  const std::size_t end = EndOfStep(white_.track, move(row));
  while (row + 1 < rows() && move(row + 1) < end &&
         turn_deg * Behind(axis, row, row + 1).norm() < 1)
    ++row;
  return row;
}

// A step of one degree as the rows from `row` to `end` show it, whitened.
Eigen::VectorXd StepRows::Behind(std::size_t axis, std::size_t row, std::size_t end) const {
  Eigen::VectorXd column(static_cast<Eigen::Index>(2 * (end - row)));
  for (std::size_t k = row; k < end; ++k)
    for (std::size_t xy = 0; xy < 2; ++xy)
      column[static_cast<Eigen::Index>(2 * (k - row) + xy)] = white_.turn_um[4 * k + 2 * axis + xy];
  ApplyFilter(std::span(white_.filter).subspan(row, end - row),
              std::span(white_.turn_um).subspan(4 * row, 4 * (end - row)), column.data());
  return column;
}

// Sums of the columns' products over all rows before each.
void StepRows::AddUp() {
  sums_.assign(1, StepProducts::Zero());
  for (std::size_t k = 0; k < rows(); ++k) {
    Eigen::Matrix<double, 2, kStepColumns> columns = Eigen::Matrix<double, 2, kStepColumns>::Zero();
    const auto at = static_cast<Eigen::Index>(2 * k);
    columns.leftCols(white_.geometry.cols()) = white_.geometry.middleRows<2>(at);
    columns.col(kGeometryColumns) = y_.segment<2>(at);
    sums_.push_back(sums_.back() + columns.transpose() * columns);
  }
}

}  // namespace focalfleet::sim
