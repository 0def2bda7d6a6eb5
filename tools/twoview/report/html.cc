#include "report/html.h"

#include <cstdint>
#include <cstdio>

namespace cli {

std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text) {
    switch (c) {
      case '&': result += "&amp;"; break;
      case '<': result += "&lt;"; break;
      case '>': result += "&gt;"; break;
      case '"': result += "&quot;"; break;
      default: result += c;
    }
  }
  return result;
}

std::string formatted(const char* format, double value) {
  char text[64];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

std::string filled(const std::string& page,
                   const std::vector<std::pair<std::string, std::string>>& values) {
  std::string result;
  size_t at = 0;
  for (size_t open; (open = page.find("{{", at)) != std::string::npos;) {
    const size_t close = page.find("}}", open);
    const std::string name = page.substr(open + 2, close - open - 2);
    result += page.substr(at, open - at);
    for (const auto& [key, value] : values)
      if (key == name) result += value;
    at = close + 2;
  }
  return result + page.substr(at);
}

std::string card(const std::string& number, const std::string& unit, const std::string& what,
                 const char* classes) {
  return std::string("<div class=\"") + classes + "\"><b>" + number +
         (unit.empty() ? "" : "<i>" + unit + "</i>") + "</b><span>" + what + "</span></div>\n";
}

std::string bullets(const std::string& css_class, const std::vector<std::string>& texts) {
  std::string items;
  for (const std::string& text : texts) items += "<li>" + escaped(text) + "</li>\n";
  return items.empty() ? "" : "<ul class=\"" + css_class + "\">\n" + items + "</ul>\n";
}

std::string base64(const std::string& bytes) {
  static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (size_t i = 0; i < bytes.size(); i += 3) {
    uint32_t group = 0;
    for (size_t j = 0; j < 3; ++j)
      group = group << 8 | (i + j < bytes.size() ? static_cast<uint8_t>(bytes[i + j]) : 0u);
    for (size_t j = 0; j < 4; ++j)
      text += i + j <= bytes.size() ? digits[group >> (18 - 6 * j) & 63] : '=';
  }
  return text;
}

}  // namespace cli
