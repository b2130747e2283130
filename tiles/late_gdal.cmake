# Writes a source of stand-ins for those functions of GDAL that archives of ours call: each jumps to GDAL's own, which
# late_gdal.cpp looks up, after loading GDAL, the first time that one is called. To load GDAL with the hundred libraries that
# it brings takes longer than many a run.
#   cmake -DARCHIVES=A.a;B.a -DGDAL=libgdal.so -DNM=nm -DOBJDUMP=objdump -DOUT=stubs.cpp -P late_gdal.cmake
cmake_minimum_required(VERSION 3.25)

function(lines_of out)
  execute_process(COMMAND ${ARGN} OUTPUT_VARIABLE words COMMAND_ERROR_IS_FATAL ANY)
  string(REGEX REPLACE "[\r\n]+" ";" words "${words}")
  set(${out} "${words}" PARENT_SCOPE)
endfunction()

lines_of(wanted ${NM} --undefined-only --format=posix ${ARCHIVES})
lines_of(offered ${NM} --dynamic --defined-only --format=posix ${GDAL})
lines_of(header ${OBJDUMP} -p ${GDAL})
list(FILTER header INCLUDE REGEX "SONAME")
string(REGEX REPLACE "^ *SONAME +([^ ]+).*$" "\\1" soname "${header}")
if(NOT soname MATCHES "\\.so")
  message(FATAL_ERROR "'${GDAL}' has no name that a program could load it by")
endif()
get_filename_component(folder ${GDAL} DIRECTORY)

# Functions alone: an object of GDAL's that we referred to would have to be there at the start, and the linker says so.
list(FILTER offered INCLUDE REGEX " [TWi] ")
list(TRANSFORM offered REPLACE "[@ ].*$" "")
list(FILTER wanted INCLUDE REGEX " U")
list(TRANSFORM wanted REPLACE " .*$" "")
# By GDAL's own names: a library that came with others inside may offer those too, and what we call there is not GDAL's.
list(FILTER wanted INCLUDE REGEX "^(GDAL|CPL|CSL|CPLE|OGR|OSR|OCT|VSI|GetGDAL|_Z(N[A-Z]*)?[0-9]+(GDAL|OGR|CPL))")
list(REMOVE_DUPLICATES wanted)
list(SORT wanted)
set(stand_ins "")
set(names "")
set(count 0)
foreach(name IN LISTS wanted)
  list(FIND offered ${name} found)
  if(found GREATER_EQUAL 0)
    string(APPEND stand_ins "late ${name} ${count}\n")
    string(APPEND names "    \"${name}\",\n")
    math(EXPR count "${count} + 1")
  endif()
endforeach()
if(count EQUAL 0)
  message(FATAL_ERROR "'${GDAL}' offers none of the functions that are called")
endif()

# System V's way of calling on x86-64: what arguments lie in is kept while GDAL is loaded.
file(CONFIGURE OUTPUT ${OUT} @ONLY CONTENT [=[// Made by tiles/late_gdal.cmake.
extern "C" const char* const wedgescope_late_gdal_library = "@soname@";
extern "C" const char* const wedgescope_late_gdal_folder = "@folder@";
extern "C" const char* const wedgescope_late_gdal_names[] = {
@names@};
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
    .globl wedgescope_late_gdal_slots
    .hidden wedgescope_late_gdal_slots
wedgescope_late_gdal_slots:
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
    call wedgescope_late_gdal_find
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
