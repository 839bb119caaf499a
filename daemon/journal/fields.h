// The fields of plain values, in the order of their declaration, without a list of them: a type
// that gets a field more is written, read and digested with it. This works for aggregates of up to
// 24 fields, for the containers that they have, and for strong ids.
//
//   WriteFields(value, &bytes);            as bytes, little-endian as this machine is
//   ReadFields(&reader, &value);           back again; false: the bytes are none of it
//
// A function object that is within a value has no bytes and is passed over.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "protocol/base/ids.h"
#include "protocol/base/result.h"
#include "protocol/wire/staged_move.h"

namespace focalfleet::journal {

namespace internal {

struct AnyValue {
  template <class T>
  operator T() const;  // NOLINT: it stands for a value of any type
};

template <class T, std::size_t... I>
constexpr bool IsMadeOf(std::index_sequence<I...>) {
  return requires { T{(static_cast<void>(I), AnyValue{})...}; };
}
/// The number of fields of an aggregate.
template <class T, std::size_t N = 24>
constexpr std::size_t FieldCount() {
  if constexpr (IsMadeOf<T>(std::make_index_sequence<N>()))
    return N;
  else if constexpr (N == 0)
    return 0;
  else
    return FieldCount<T, N - 1>();
}

/// Calls `each` with every field.
template <class T, class Each>
void ForFields(T& value, const Each& each) {
  constexpr std::size_t kFields = FieldCount<std::remove_const_t<T>>();
  const auto all = [&](auto&... field) { (each(field), ...); };
  if constexpr (kFields == 0) {
  } else if constexpr (kFields == 1) {
    auto& [a] = value;
    all(a);
  } else if constexpr (kFields == 2) {
    auto& [a, b] = value;
    all(a, b);
  } else if constexpr (kFields == 3) {
    auto& [a, b, c] = value;
    all(a, b, c);
  } else if constexpr (kFields == 4) {
    auto& [a, b, c, d] = value;
    all(a, b, c, d);
  } else if constexpr (kFields == 5) {
    auto& [a, b, c, d, e] = value;
    all(a, b, c, d, e);
  } else if constexpr (kFields == 6) {
    auto& [a, b, c, d, e, f] = value;
    all(a, b, c, d, e, f);
  } else if constexpr (kFields == 7) {
    auto& [a, b, c, d, e, f, g] = value;
    all(a, b, c, d, e, f, g);
  } else if constexpr (kFields == 8) {
    auto& [a, b, c, d, e, f, g, h] = value;
    all(a, b, c, d, e, f, g, h);
  } else if constexpr (kFields == 9) {
    auto& [a, b, c, d, e, f, g, h, i] = value;
    all(a, b, c, d, e, f, g, h, i);
  } else if constexpr (kFields == 10) {
    auto& [a, b, c, d, e, f, g, h, i, j] = value;
    all(a, b, c, d, e, f, g, h, i, j);
  } else if constexpr (kFields == 11) {
    auto& [a, b, c, d, e, f, g, h, i, j, k] = value;
    all(a, b, c, d, e, f, g, h, i, j, k);
  } else if constexpr (kFields == 12) {
    auto& [a, b, c, d, e, f, g, h, i, j, k, l] = value;
    all(a, b, c, d, e, f, g, h, i, j, k, l);
  } else if constexpr (kFields == 13) {
    auto& [a, b, c, d, e, f, g, h, i, j, k, l, m] = value;
    all(a, b, c, d, e, f, g, h, i, j, k, l, m);
  } else if constexpr (kFields == 14) {
    auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n] = value;
    all(a, b, c, d, e, f, g, h, i, j, k, l, m, n);
  } else if constexpr (kFields == 15) {
    auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o] = value;
    all(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o);
  } else if constexpr (kFields == 16) {
    auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p] = value;
    all(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p);
  } else if constexpr (kFields == 17) {
    auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q] = value;
    all(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q);
  } else if constexpr (kFields == 18) {
    auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r] = value;
    all(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r);
  } else if constexpr (kFields == 19) {
    auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s] = value;
    all(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s);
  } else if constexpr (kFields == 20) {
    auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s, t] = value;
    all(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s, t);
  } else if constexpr (kFields == 21) {
    auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s, t, u] = value;
    all(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s, t, u);
  } else if constexpr (kFields == 22) {
    auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s, t, u, v] = value;
    all(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s, t, u, v);
  } else if constexpr (kFields == 23) {
    auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s, t, u, v, w] = value;
    all(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s, t, u, v, w);
  } else {
    static_assert(kFields == 24, "a case for so many fields is missing here");
    auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s, t, u, v, w, x] = value;
    all(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s, t, u, v, w, x);
  }
}

}  // namespace internal

struct ByteReader {
  std::string_view left;
  bool good = true;

  void Take(void* out, std::size_t size) {
    good = good && size <= left.size();
    if (!good) return;
    std::memcpy(out, left.data(), size);
    left.remove_prefix(size);
  }
};

template <class T>
void WriteFields(const T& value, std::string* out);
template <class T>
void ReadFields(ByteReader* in, T* value);

namespace internal {

// The kinds of values; the last one that fits is an aggregate.
template <class T>
struct Kind {
  static void Write(const T& value, std::string* out) {
    if constexpr (std::is_arithmetic_v<T> || std::is_enum_v<T>) {
      out->append(reinterpret_cast<const char*>(&value), sizeof value);
    } else {
      ForFields(value, [out](const auto& field) { WriteFields(field, out); });
    }
  }
  static void Read(ByteReader* in, T* value) {
    if constexpr (std::is_arithmetic_v<T> || std::is_enum_v<T>) {
      in->Take(value, sizeof *value);
    } else {
      ForFields(*value, [in](auto& field) { ReadFields(in, &field); });
    }
  }
};
template <>
struct Kind<bool> {
  static void Write(bool value, std::string* out) { out->push_back(value ? 1 : 0); }
  static void Read(ByteReader* in, bool* value) {
    char byte = 0;
    in->Take(&byte, 1);
    *value = byte != 0;
  }
};
inline void WriteSize(std::size_t size, std::string* out) {
  Kind<std::uint32_t>::Write(static_cast<std::uint32_t>(size), out);
}
inline std::size_t ReadSize(ByteReader* in) {
  std::uint32_t size = 0;
  in->Take(&size, sizeof size);
  in->good = in->good && size <= in->left.size();  // an element takes a byte at least
  return in->good ? size : 0;
}
template <class Signature>
struct Kind<std::function<Signature>> {
  static void Write(const std::function<Signature>&, std::string*) {}
  static void Read(ByteReader*, std::function<Signature>*) {}
};
template <class Tag, class Rep>
struct Kind<StrongId<Tag, Rep>> {
  static void Write(const StrongId<Tag, Rep>& id, std::string* out) { WriteFields(id.value, out); }
  static void Read(ByteReader* in, StrongId<Tag, Rep>* id) { ReadFields(in, &id->value); }
};
template <>
struct Kind<std::string> {
  static void Write(const std::string& text, std::string* out) {
    WriteSize(text.size(), out);
    out->append(text);
  }
  static void Read(ByteReader* in, std::string* text) {
    text->resize(ReadSize(in));
    in->Take(text->data(), text->size());
  }
};
template <>
struct Kind<AxisPath> {
  static void Write(const AxisPath& path, std::string* out) {
    WriteFields(path.size(), out);
    for (const Segment& segment : path.segments()) WriteFields(segment, out);
  }
  static void Read(ByteReader* in, AxisPath* path) {
    std::uint8_t size = 0;
    ReadFields(in, &size);
    in->good = in->good && size <= limits::kSegmentsPerAxis;
    *path = {};
    for (std::uint8_t n = 0; n < size && in->good; ++n) {
      Segment segment;
      ReadFields(in, &segment);
      path->Append(segment);
    }
  }
};
template <class T, std::size_t N>
struct Kind<std::array<T, N>> {
  static void Write(const std::array<T, N>& list, std::string* out) {
    for (const T& element : list) WriteFields(element, out);
  }
  static void Read(ByteReader* in, std::array<T, N>* list) {
    for (T& element : *list) ReadFields(in, &element);
  }
};
template <class T>
struct Kind<std::vector<T>> {
  static void Write(const std::vector<T>& list, std::string* out) {
    WriteSize(list.size(), out);
    for (const T& element : list) WriteFields(element, out);
  }
  static void Read(ByteReader* in, std::vector<T>* list) {
    // Elements are made one by one: a length that was never written asks for no memory.
    list->clear();
    for (std::size_t left = ReadSize(in); left > 0 && in->good; --left)
      ReadFields(in, &list->emplace_back());
  }
};
template <class T>
struct Kind<std::optional<T>> {
  static void Write(const std::optional<T>& value, std::string* out) {
    WriteFields(value.has_value(), out);
    if (value) WriteFields(*value, out);
  }
  static void Read(ByteReader* in, std::optional<T>* value) {
    bool there = false;
    ReadFields(in, &there);
    if (there) ReadFields(in, &value->emplace());
  }
};
template <class T>
struct Kind<std::shared_ptr<const T>> {
  static void Write(const std::shared_ptr<const T>& value, std::string* out) {
    WriteFields(value != nullptr, out);
    if (value != nullptr) WriteFields(*value, out);
  }
  static void Read(ByteReader* in, std::shared_ptr<const T>* value) {
    bool there = false;
    ReadFields(in, &there);
    if (!there) return value->reset();
    T read{};
    ReadFields(in, &read);
    *value = std::make_shared<const T>(std::move(read));
  }
};
template <>
struct Kind<std::shared_ptr<const std::string>> {
  static void Write(const std::shared_ptr<const std::string>& text, std::string* out) {
    WriteFields(text == nullptr ? std::string() : *text, out);
  }
  static void Read(ByteReader* in, std::shared_ptr<const std::string>* text) {
    std::string read;
    ReadFields(in, &read);
    *text = read.empty() ? nullptr : std::make_shared<const std::string>(std::move(read));
  }
};
template <class... T>
struct Kind<std::variant<T...>> {
  static void Write(const std::variant<T...>& value, std::string* out) {
    WriteFields(static_cast<std::uint8_t>(value.index()), out);
    std::visit([out](const auto& held) { WriteFields(held, out); }, value);
  }
  static void Read(ByteReader* in, std::variant<T...>* value) {
    std::uint8_t index = 0;
    ReadFields(in, &index);
    in->good = in->good && index < sizeof...(T);
    std::uint8_t n = 0;
    const auto one = [&](auto* held) {
      if (n++ != index || !in->good) return;
      ReadFields(in, held);
      *value = std::move(*held);
    };
    std::tuple<T...> each;
    std::apply([&](T&... held) { (one(&held), ...); }, each);
  }
};
template <class T>
struct Kind<Result<T>> {
  static void Write(const Result<T>& result, std::string* out) {
    WriteFields(result.has_value(), out);
    if (result)
      WriteFields(*result, out);
    else
      WriteFields(result.error(), out);
  }
  static void Read(ByteReader* in, Result<T>* result) {
    bool good = false;
    ReadFields(in, &good);
    if (good) {
      T value{};
      ReadFields(in, &value);
      *result = std::move(value);
    } else {
      Error error;
      ReadFields(in, &error);
      *result = tl::unexpected<Error>(std::move(error));
    }
  }
};

}  // namespace internal

template <class T>
void WriteFields(const T& value, std::string* out) {
  internal::Kind<T>::Write(value, out);
}
template <class T>
void ReadFields(ByteReader* in, T* value) {
  internal::Kind<T>::Read(in, value);
}

}  // namespace focalfleet::journal
