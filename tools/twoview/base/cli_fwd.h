// The names of CLI11 that the program's headers pass on. A source that adds options includes
// <CLI/App.hpp> itself; parsing it takes as long as compiling most of the sources.
#pragma once

namespace CLI {

class App;
class Option;
class Validator;

}  // namespace CLI
