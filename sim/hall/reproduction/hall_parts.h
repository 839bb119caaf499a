// The data that the parts of ReproduceHall share: both arrays, their maps and models, made once.
#pragma once

#include <memory>

#include "sim/hall/field_fit.h"
#include "sim/hall/orient.h"
#include "sim/hall/reproduction/hall_reproduce.h"

namespace focalfleet::sim::reproduction {

struct HallArray {
  const char* name = "";  // "2D", "3D"
  MagnetArray magnets;
  FieldMap map;
  FieldFit fits[3];  // by FieldKind
  std::shared_ptr<const FieldModel> models[3];

  /// Fields at the eight sensors. Units: T.
  [[nodiscard]] std::vector<double> Fields(const Orientation& orientation) const;
};
HallArray MakeHallArray(const char* name, const std::vector<MagnetShell>& shells);

void AddHallClaims(const HallReproduceOptions& options, const HallArray& two,
                   const HallArray& three, Reproduction* out);
void AddHallFigures(const HallReproduceOptions& options, const HallArray& two,
                    const HallArray& three, Reproduction* out);

}  // namespace focalfleet::sim::reproduction
