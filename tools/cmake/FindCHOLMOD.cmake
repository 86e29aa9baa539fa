# Finds SuiteSparse CHOLMOD with METIS and the serial OpenBLAS below it, and defines the target sinew::cholmod.
#
# Everything is linked statically but METIS. Debian's libcholmod.so takes whatever libblas.so.3 and libopenblas.so.0
# the alternatives of the machine name at run time, and a threaded BLAS adds in an order that depends on the number
# of threads: the same input would no longer give the same bits.
#
# Cache variables: CHOLMOD_INCLUDE_DIR, CHOLMOD_<name>_LIBRARY, SINEW_OPENBLAS_SERIAL.

include(FindPackageHandleStandardArgs)

find_path(CHOLMOD_INCLUDE_DIR NAMES cholmod.h PATH_SUFFIXES suitesparse)

set(_cholmod_required CHOLMOD_INCLUDE_DIR)
set(_cholmod_libraries "")
foreach(_name cholmod ccolamd colamd camd amd suitesparseconfig)  # users before what they use
  find_library(CHOLMOD_${_name}_LIBRARY NAMES lib${_name}.a)
  mark_as_advanced(CHOLMOD_${_name}_LIBRARY)
  list(APPEND _cholmod_required CHOLMOD_${_name}_LIBRARY)
  list(APPEND _cholmod_libraries "${CHOLMOD_${_name}_LIBRARY}")
endforeach()

# Debian ships METIS' development link only with the METIS headers, which are not needed here.
find_library(CHOLMOD_metis_LIBRARY NAMES metis libmetis.so.5)
# The directory bears the name of the build; the library in it is never the alternatives' choice.
find_library(SINEW_OPENBLAS_SERIAL NAMES libopenblas.a PATH_SUFFIXES openblas-serial
             PATHS /usr/lib/${CMAKE_LIBRARY_ARCHITECTURE}/openblas-serial NO_DEFAULT_PATH)
mark_as_advanced(CHOLMOD_INCLUDE_DIR CHOLMOD_metis_LIBRARY SINEW_OPENBLAS_SERIAL)

if(EXISTS "${CHOLMOD_INCLUDE_DIR}/cholmod_core.h")
  file(STRINGS "${CHOLMOD_INCLUDE_DIR}/cholmod_core.h" _cholmod_version
       REGEX "^#define CHOLMOD_(MAIN|SUB|SUBSUB)_VERSION[ \t]+[0-9]+")
  string(REGEX REPLACE "#define CHOLMOD_[A-Z]+_VERSION[ \t]+" "" CHOLMOD_VERSION "${_cholmod_version}")
  string(REPLACE ";" "." CHOLMOD_VERSION "${CHOLMOD_VERSION}")
endif()

find_package_handle_standard_args(CHOLMOD
  REQUIRED_VARS ${_cholmod_required} CHOLMOD_metis_LIBRARY SINEW_OPENBLAS_SERIAL
  VERSION_VAR CHOLMOD_VERSION
  REASON_FAILURE_MESSAGE "Debian packages: libsuitesparse-dev libopenblas-serial-dev")

if(CHOLMOD_FOUND AND NOT TARGET sinew::cholmod)
  include(CMakeFindDependencyMacro)
  find_dependency(Threads)
  add_library(sinew::cholmod INTERFACE IMPORTED)
  set_target_properties(sinew::cholmod PROPERTIES
    INTERFACE_INCLUDE_DIRECTORIES "${CHOLMOD_INCLUDE_DIR}"
    # gomp: CHOLMOD's supernodal loops; m, pthread, dl: OpenBLAS.
    INTERFACE_LINK_LIBRARIES
      "${_cholmod_libraries};${CHOLMOD_metis_LIBRARY};${SINEW_OPENBLAS_SERIAL};gomp;m;Threads::Threads;${CMAKE_DL_LIBS}")
endif()
