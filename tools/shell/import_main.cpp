// sinew-import: reads one file with third-party importers on behalf of sinew, which starts it and reads its
// answer from descriptor 3. Not meant to be called by hand.
#include "assets/detail/importer_process.h"

int main(int argc, char** argv) { return sinew::assets::detail::importer_main(argc, argv); }
