// What late_libraries.cmake writes and late_libraries.cpp reads: the libraries, and the functions of theirs that are called.
#pragma once

struct WedgescopeLateLibrary {
    const char *name, *file, *folder;
};
struct WedgescopeLateFunction {
    const char* name;
    unsigned library;  ///< number in the list of libraries
};

extern "C" {
extern const WedgescopeLateLibrary wedgescope_late_libraries[];
extern const WedgescopeLateFunction wedgescope_late_functions[];
}
