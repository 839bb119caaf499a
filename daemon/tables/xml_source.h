// Tables in XML. Elements of one name that follow each other under one parent are the rows of a
// table of that name. All that stands below a row, however deep, are its cells: an element with a
// text alone is a column of the element's name, an attribute one of the attribute's. Where an inner
// name occurs twice in a row, the second column is called `outer.inner`. VOTable has its own rows
// (TR) and columns (FIELD, with units).
#pragma once

#include <string>

#include "daemon/tables/source_table.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// Errors: kInvalid with name:line: not well formed, with entities of its own, nested too deep;
/// name alone: no table.
Result<SourceFile> ReadXmlSource(const std::string& text, const std::string& name);

}  // namespace focalfleet
