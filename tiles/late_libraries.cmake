# Writes a source of stand-ins for those functions of some libraries that archives of ours call: each jumps to the library's own,
# which late_libraries.cpp looks up, after loading the library, the first time that one is called. To load GDAL with the hundred
# libraries that it brings, or PROJ with thirty, takes longer than many a run.
#   cmake -DARCHIVES=A.a;B.a -DNAMES=GDAL;PROJ -DLIBRARIES=libgdal.so;libproj.so -DNM=nm -DOBJDUMP=objdump -DOUT=stubs.cpp
#     -P late_libraries.cmake
cmake_minimum_required(VERSION 3.25)

# By each library's own names: one that came with others inside may offer those too, and what we call there is not its.
set(own_GDAL "^(GDAL|CPL|CSL|CPLE|OGR|OSR|OCT|VSI|GetGDAL|_Z(N[A-Z]*)?[0-9]+(GDAL|OGR|CPL))")
set(own_PROJ "^proj_")

function(lines_of out)
  execute_process(COMMAND ${ARGN} OUTPUT_VARIABLE words COMMAND_ERROR_IS_FATAL ANY)
  string(REGEX REPLACE "[\r\n]+" ";" words "${words}")
  set(${out} "${words}" PARENT_SCOPE)
endfunction()

lines_of(called ${NM} --undefined-only --format=posix ${ARCHIVES})
list(FILTER called INCLUDE REGEX " U")
list(TRANSFORM called REPLACE " .*$" "")
list(REMOVE_DUPLICATES called)
list(SORT called)
set(libraries "")
set(functions "")
set(stand_ins "")
set(count 0)
set(number 0)
foreach(name library IN ZIP_LISTS NAMES LIBRARIES)
  lines_of(offered ${NM} --dynamic --defined-only --format=posix ${library})
  lines_of(header ${OBJDUMP} -p ${library})
  list(FILTER header INCLUDE REGEX "SONAME")
  string(REGEX REPLACE "^ *SONAME +([^ ]+).*$" "\\1" soname "${header}")
  if(NOT soname MATCHES "\\.so")
    message(FATAL_ERROR "'${library}' has no name that a program could load it by")
  endif()
  get_filename_component(folder ${library} DIRECTORY)
  string(APPEND libraries "    {\"${name}\", \"${soname}\", \"${folder}\"},\n")
  # Functions alone: an object that we referred to would have to be there at the start, and the linker says so.
  list(FILTER offered INCLUDE REGEX " [TWi] ")
  list(TRANSFORM offered REPLACE "[@ ].*$" "")
  set(wanted ${called})
  list(FILTER wanted INCLUDE REGEX "${own_${name}}")
  set(before ${count})
  foreach(function IN LISTS wanted)
    list(FIND offered ${function} found)
    if(found GREATER_EQUAL 0)
      string(APPEND stand_ins "late ${function} ${count}\n")
      string(APPEND functions "    {\"${function}\", ${number}},\n")
      math(EXPR count "${count} + 1")
    endif()
  endforeach()
  if(count EQUAL before)
    message(FATAL_ERROR "'${library}' offers none of the functions that are called")
  endif()
  math(EXPR number "${number} + 1")
endforeach()

# System V's way of calling on x86-64: what arguments lie in is kept while a library is loaded.
file(CONFIGURE OUTPUT ${OUT} @ONLY CONTENT [=[// Made by tiles/late_libraries.cmake.
#include "tiles/late_libraries.hpp"

extern "C" const WedgescopeLateLibrary wedgescope_late_libraries[] = {
@libraries@};
extern "C" const WedgescopeLateFunction wedgescope_late_functions[] = {
@functions@};
asm(R"(
    .pushsection .text
    .macro late name number
    .text
    .globl \name
    .hidden \name
    .type \name, @function
\name:
    endbr64
    jmp *.Llate\number(%rip)
    .size \name, . - \name
.Lfirst\number:
    endbr64
    pushq $\number
    jmp .Lfind
    .data
    .balign 8
.Llate\number:
    .quad .Lfirst\number
    .endm

    .data
    .balign 8
    .globl wedgescope_late_slots
    .hidden wedgescope_late_slots
wedgescope_late_slots:
@stand_ins@
    .text
    .type .Lfind, @function
.Lfind:
    .cfi_startproc
    .cfi_def_cfa_offset 16
    push %rax
    push %rcx
    push %rdx
    push %rsi
    push %rdi
    push %r8
    push %r9
    push %r10
    sub $128, %rsp
    .cfi_def_cfa_offset 208
    movups %xmm0, (%rsp)
    movups %xmm1, 16(%rsp)
    movups %xmm2, 32(%rsp)
    movups %xmm3, 48(%rsp)
    movups %xmm4, 64(%rsp)
    movups %xmm5, 80(%rsp)
    movups %xmm6, 96(%rsp)
    movups %xmm7, 112(%rsp)
    mov 192(%rsp), %rdi
    call wedgescope_late_find
    mov %rax, %r11
    movups (%rsp), %xmm0
    movups 16(%rsp), %xmm1
    movups 32(%rsp), %xmm2
    movups 48(%rsp), %xmm3
    movups 64(%rsp), %xmm4
    movups 80(%rsp), %xmm5
    movups 96(%rsp), %xmm6
    movups 112(%rsp), %xmm7
    add $128, %rsp
    pop %r10
    pop %r9
    pop %r8
    pop %rdi
    pop %rsi
    pop %rdx
    pop %rcx
    pop %rax
    add $8, %rsp
    jmp *%r11
    .cfi_endproc
    .popsection
)");
]=])
