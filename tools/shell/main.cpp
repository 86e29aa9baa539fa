#include <cstdio>
#include <cstdlib>
#include <exception>

#include "tools/shell/run.h"
#include "tools/terminal/exit_code.h"
#include "tools/terminal/interrupt.h"

int main(int argc, char** argv) {
  // What no handler can catch any more (an exception in a destructor or a foreign thread) still ends with one
  // line.
  std::set_terminate([] {
    std::fputs("sinew: internal error: an exception could not be handled (a bug)\n", stderr);
    std::_Exit(sinew::tools::exit_code::kInternalError);
  });
  sinew::tools::install_interrupt_handlers();
  return sinew::tools::run(argc, argv);
}
