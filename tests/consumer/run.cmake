# Installs the build tree into a fresh prefix, then builds and runs the consumer against the installed package only.
# cmake -DBUILD_DIR=... -DSOURCE_DIR=... -DWORK_DIR=... -DCXX_COMPILER=... -DCXX_FLAGS=... -P run.cmake
function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT result EQUAL 0)
    string(JOIN " " command ${ARGN})
    message(FATAL_ERROR "${command}\n${output}\nexit code ${result}")
  endif()
  set(output "${output}" PARENT_SCOPE)
endfunction()

file(REMOVE_RECURSE "${WORK_DIR}")
run(${CMAKE_COMMAND} --install "${BUILD_DIR}" --prefix "${WORK_DIR}/prefix")
run(${CMAKE_COMMAND} -S "${SOURCE_DIR}" -B "${WORK_DIR}/build" -G Ninja -DCMAKE_BUILD_TYPE=Release
    "-DCMAKE_CXX_COMPILER=${CXX_COMPILER}" "-DCMAKE_CXX_FLAGS=${CXX_FLAGS}"
    "-DCMAKE_PREFIX_PATH=${WORK_DIR}/prefix")
run(${CMAKE_COMMAND} --build "${WORK_DIR}/build")
# Rigs are read by the installed importer, which is found on the PATH.
set(ENV{PATH} "${WORK_DIR}/prefix/bin:$ENV{PATH}")
run("${WORK_DIR}/build/consumer" "${SOURCE_DIR}/../../assets/samples/arm.glb")
if(NOT output MATCHES "^frame 0: ([0-9]+) vertices, moved\nframe 1: [0-9]+ vertices, moved\n2 frames\n$")
  message(FATAL_ERROR "the consumer printed: ${output}")
endif()
# The installed command runs from its new place.
run("${WORK_DIR}/prefix/bin/sinew" --version)
