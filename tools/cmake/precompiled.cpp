// The object that owns the precompiled headers (CMakeLists.txt).
