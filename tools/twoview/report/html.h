// Pieces of HTML that the reports have in common.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace cli {

// The text with the characters that HTML reserves replaced.
std::string escaped(const std::string& text);

// A number in a format of printf.
std::string formatted(const char* format, double value);

// Replaces each {{name}} of the page once. Inserted text is not searched for further names.
std::string filled(const std::string& page,
                   const std::vector<std::pair<std::string, std::string>>& values);

// A card with a number and what it is.
std::string card(const std::string& number, const std::string& unit, const std::string& what,
                 const char* classes = "card");

// A list with a line of each text; nothing without texts.
std::string bullets(const std::string& css_class, const std::vector<std::string>& texts);

// Encodes bytes as Base64 (RFC 4648) with padding.
std::string base64(const std::string& bytes);

}  // namespace cli
