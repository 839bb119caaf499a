#include "daemon/tables/xml_source.h"

#include <expat.h>

#include <algorithm>
#include <memory>
#include <utility>

#include "fleet/files/cell.h"
#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

struct Element {
  std::string name;
  int line = 0;
  std::vector<std::pair<std::string, std::string>> attributes;
  std::string text;
  std::vector<std::unique_ptr<Element>> children;

  [[nodiscard]] const std::string* Attribute(std::string_view wanted) const {
    for (const auto& [key, value] : attributes)
      if (key == wanted) return &value;
    return nullptr;
  }
};

/// Builds the tree of elements. Expat calls back; faults end the parse.
class TreeBuilder {
 public:
  Result<std::unique_ptr<Element>> Build(const std::string& text, const std::string& name) {
    const std::unique_ptr<std::remove_pointer_t<XML_Parser>, decltype(&XML_ParserFree)> parser(
        XML_ParserCreate(nullptr), &XML_ParserFree);
    if (!parser) return Fail(ErrorCode::kFull, name + ": there is no memory to read it");
    parser_ = parser.get();
    XML_SetUserData(parser_, this);
    XML_SetElementHandler(parser_, &TreeBuilder::Begin, &TreeBuilder::End);
    XML_SetCharacterDataHandler(parser_, &TreeBuilder::Text);
    XML_SetEntityDeclHandler(parser_, &TreeBuilder::Entity);
    constexpr std::size_t kPiece = std::size_t{1} << 20;
    std::size_t at = 0;
    do {
      const std::size_t size = std::min(kPiece, text.size() - at);
      const bool last = at + size == text.size();
      if (XML_Parse(parser_, text.data() + at, static_cast<int>(size), last ? 1 : 0) !=
          XML_STATUS_OK)
        return Fail(ErrorCode::kInvalid,
                    name + ":" + std::to_string(XML_GetCurrentLineNumber(parser_)) + ": " +
                        (fault_ != nullptr ? fault_ : XML_ErrorString(XML_GetErrorCode(parser_))));
      at += size;
    } while (at < text.size());
    return std::move(root_);
  }

 private:
  static TreeBuilder& Of(void* data) { return *static_cast<TreeBuilder*>(data); }

  static void Begin(void* data, const XML_Char* name, const XML_Char** attributes) {
    TreeBuilder& self = Of(data);
    if (self.open_.size() >= limits::kTableDepth) return self.Stop("elements are nested too deep");
    auto element = std::make_unique<Element>();
    const std::string_view local = std::string_view(name).substr(
        std::string_view(name).find_last_of(':') + 1);  // without its namespace's prefix
    element->name = local;
    element->line = static_cast<int>(XML_GetCurrentLineNumber(self.parser_));
    for (; attributes[0] != nullptr; attributes += 2)
      element->attributes.emplace_back(attributes[0], attributes[1]);
    Element* const raw = element.get();
    if (self.open_.empty()) {
      self.root_ = std::move(element);
    } else {
      self.open_.back()->children.push_back(std::move(element));
    }
    self.open_.push_back(raw);
  }
  static void End(void* data, const XML_Char* /*name*/) { Of(data).open_.pop_back(); }
  static void Text(void* data, const XML_Char* text, int size) {
    TreeBuilder& self = Of(data);
    if (!self.open_.empty()) self.open_.back()->text.append(text, static_cast<std::size_t>(size));
  }
  // Entities of a file can be made to expand without end, and nobody's tables need them.
  static void Entity(void* data, const XML_Char* /*name*/, int /*is_parameter*/,
                     const XML_Char* /*value*/, int /*length*/, const XML_Char* /*base*/,
                     const XML_Char* /*system*/, const XML_Char* /*id*/,
                     const XML_Char* /*notation*/) {
    Of(data).Stop("entities of its own are not read");
  }

  void Stop(const char* fault) {
    fault_ = fault;
    XML_StopParser(parser_, XML_FALSE);
  }

  XML_Parser parser_ = nullptr;
  std::unique_ptr<Element> root_;
  std::vector<Element*> open_;
  const char* fault_ = nullptr;
};

std::string TrimmedText(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(" \t\r\n");
  if (begin == std::string_view::npos) return {};
  return std::string(text.substr(begin, text.find_last_not_of(" \t\r\n") - begin + 1));
}

void PutCells(const Element& element, const Element* outer, RowCollector* rows) {
  const auto put = [&](const std::string& name, std::string value) {
    const bool twice = rows->Has(name) && outer != nullptr;
    rows->Put(twice ? outer->name + "." + name : name, std::move(value));
  };
  for (const auto& [key, value] : element.attributes) put(key, value);
  if (element.children.empty()) {
    if (element.attributes.empty() || !TrimmedText(element.text).empty())
      put(element.name, TrimmedText(element.text));
    return;
  }
  for (const auto& child : element.children) PutCells(*child, &element, rows);
}

SourceTable TableOfElements(const std::vector<const Element*>& elements) {
  RowCollector rows;
  for (const Element* element : elements) {
    rows.Begin(element->line);
    PutCells(*element, nullptr, &rows);
  }
  return std::move(rows).Take(elements.front()->name);
}

using Group = std::vector<const Element*>;

/// The children with attributes or children of their own, by name.
std::vector<Group> GroupsOf(const Group& parents) {
  std::vector<Group> groups;
  for (const Element* parent : parents) {
    for (const auto& child : parent->children) {
      if (child->children.empty() && child->attributes.empty()) continue;
      const auto same = std::ranges::find_if(
          groups, [&](const Group& group) { return group.front()->name == child->name; });
      if (same == groups.end())
        groups.push_back({child.get()});
      else
        same->push_back(child.get());
    }
  }
  return groups;
}

bool HasRepeats(const Element& element) {
  return std::ranges::any_of(GroupsOf({&element}), [](const Group& group) {
    return group.size() > 1 || HasRepeats(*group.front());
  });
}

/// The tables below `parents`: of elements of one name that occur twice. Elements that hold such
/// ones are no rows but lists of them, of which there may be several.
void AddTables(const Group& parents, std::vector<SourceTable>* tables) {
  for (const Group& group : GroupsOf(parents)) {
    if (std::ranges::any_of(group, [](const Element* each) { return HasRepeats(*each); })) {
      AddTables(group, tables);
    } else {
      tables->push_back(TableOfElements(group));
    }
  }
}

/// The text that stands for no value in a FIELD's column; empty where none does.
std::string NullOf(const Element& field) {
  for (const auto& child : field.children)
    if (const std::string* null = child->Attribute("null"); child->name == "VALUES" && null)
      return *null;
  return {};
}

Status AddVoTables(const Element& element, const std::string& file,
                   std::vector<SourceTable>* tables) {
  if (element.name != "TABLE") {
    for (const auto& child : element.children) FOCALFLEET_TRY(AddVoTables(*child, file, tables));
    return {};
  }
  const auto fail = [&](const Element& at, const std::string& reason) {
    return Fail(ErrorCode::kInvalid, file + ":" + std::to_string(at.line) + ": " + reason);
  };
  SourceTable table;
  if (const std::string* name = element.Attribute("name")) table.name = *name;
  table.header_place = element.line;
  std::vector<std::vector<std::string>> columns;
  std::vector<std::string> nulls;
  for (const auto& child : element.children) {
    if (child->name != "FIELD") continue;
    nulls.push_back(NullOf(*child));
    const std::string* name = child->Attribute("name");
    const std::string* unit = child->Attribute("unit");
    table.columns.push_back({name != nullptr ? *name : "", unit != nullptr ? *unit : "", {}});
    columns.emplace_back();
  }
  for (const auto& data : element.children) {
    if (data->name != "DATA") continue;
    for (const auto& form : data->children) {
      if (form->name != "TABLEDATA")
        return fail(*form, "a VOTable in " + form->name + " is not read: write it as TABLEDATA");
      for (const auto& row : form->children) {
        if (row->name != "TR") continue;
        if (row->children.size() > columns.size())
          return fail(*row, std::to_string(row->children.size()) + " cells for " +
                                std::to_string(columns.size()) + " columns");
        for (std::size_t k = 0; k < columns.size(); ++k) {
          std::string cell =
              k < row->children.size() ? TrimmedText(row->children[k]->text) : std::string();
          columns[k].push_back(cell == nulls[k] ? std::string() : std::move(cell));
        }
        table.places.push_back(row->line);
      }
    }
  }
  for (std::size_t k = 0; k < columns.size(); ++k) table.columns[k].values = std::move(columns[k]);
  if (!table.columns.empty()) tables->push_back(std::move(table));
  return {};
}

}  // namespace

Result<SourceFile> ReadXmlSource(const std::string& text, const std::string& name) {
  FOCALFLEET_TRY_ASSIGN(const std::unique_ptr<Element> root, TreeBuilder().Build(text, name));
  SourceFile file{.format = "an XML file", .tables = {}};
  if (root->name == "VOTABLE") {
    file.format = "a VOTable";
    FOCALFLEET_TRY(AddVoTables(*root, name, &file.tables));
  } else {
    AddTables({root.get()}, &file.tables);
    for (SourceTable& table : file.tables)
      for (const auto& child : root->children)
        if (child->children.empty()) table.keys.emplace_back(child->name, TrimmedText(child->text));
  }
  if (file.tables.empty())
    return Fail(ErrorCode::kInvalid, name +
                                         ": no table in this XML file: repeated elements are "
                                         "expected as rows");
  return file;
}

}  // namespace focalfleet
