# Writes lattice::builder_version(). -DOUT=<file> -DVERSIONS=<text> -DSOURCES=<files, separated by |>
string(REPLACE "|" ";" sources "${SOURCES}")
set(all "${VERSIONS}")
foreach(source IN LISTS sources)
  file(SHA256 ${source} hash)
  string(APPEND all " ${hash}")
endforeach()
string(SHA256 version "${all}")
file(WRITE ${OUT}.new "#include \"lattice/builder_version.h\"\n\n"
  "const char* sinew::lattice::builder_version() { return \"${version}\"; }\n")
execute_process(COMMAND ${CMAKE_COMMAND} -E copy_if_different ${OUT}.new ${OUT})
file(REMOVE ${OUT}.new)
