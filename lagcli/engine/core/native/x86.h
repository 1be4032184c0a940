/* Encoding of the instructions of x86-64 and AVX2 that are emitted (Intel's manual, volume 2, VEX prefix). */
#ifndef LAGCLI_NATIVE_X86_H
#define LAGCLI_NATIVE_X86_H

#include <stdint.h>
#include <string.h>

typedef struct {
    uint8_t *at;                       /* where the next instruction goes */
} lag_x86;

enum { X86_RAX, X86_RCX, X86_RDX, X86_RBX, X86_RSP, X86_RBP, X86_RSI, X86_RDI, X86_R8 };

/* A floating-point register, or a place in memory: a base register (RBX or RBP) and bytes from there, with the bytes
 * in RAX added. */
typedef struct {
    int8_t base, reg;                  /* base 0: register */
    uint8_t indexed;
    int32_t bytes;
} lag_operand;

/* What follows the prefix: an opcode and its map; `scalar`, `packed`: the prefix for one number and for several. */
typedef struct {
    uint8_t opcode, map, scalar, packed;
} lag_instruction;

enum { X86_NONE, X86_66, X86_F3, X86_F2 };

#define X86_ADD ((lag_instruction){0x58, 1, X86_F2, X86_66})
#define X86_MUL ((lag_instruction){0x59, 1, X86_F2, X86_66})
#define X86_SUB ((lag_instruction){0x5C, 1, X86_F2, X86_66})
#define X86_DIV ((lag_instruction){0x5E, 1, X86_F2, X86_66})
#define X86_SQRT ((lag_instruction){0x51, 1, X86_F2, X86_66})
#define X86_MAX ((lag_instruction){0x5F, 1, X86_F2, X86_66})
#define X86_COMPARE ((lag_instruction){0xC2, 1, X86_F2, X86_66})
#define X86_AND ((lag_instruction){0x54, 1, X86_66, X86_66})
#define X86_XOR ((lag_instruction){0x57, 1, X86_66, X86_66})
#define X86_LOAD ((lag_instruction){0x10, 1, X86_F2, X86_66})
#define X86_STORE ((lag_instruction){0x11, 1, X86_F2, X86_66})
#define X86_LOAD_HIGH ((lag_instruction){0x16, 1, X86_66, X86_66})
#define X86_COPY ((lag_instruction){0x28, 1, X86_66, X86_66})
#define X86_BROADCAST ((lag_instruction){0x19, 2, X86_66, X86_66})
#define X86_INSERT ((lag_instruction){0x18, 3, X86_66, X86_66})
#define X86_CHOOSE ((lag_instruction){0x4B, 3, X86_66, X86_66})

enum { X86_EQ = 0, X86_LT = 1, X86_LE = 2, X86_NE = 4 }; /* NE also where one is NaN */

static inline void x86_byte(lag_x86 *x, int value)
{
    *x->at++ = (uint8_t)value;
}

static inline void x86_word(lag_x86 *x, int32_t value)
{
    memcpy(x->at, &value, sizeof value);
    x->at += sizeof value;
}

static inline lag_operand x86_register(int reg)
{
    return (lag_operand){.reg = (int8_t)reg};
}

/* The register or memory operand after an opcode, with a register beside it. */
static inline void x86_operand(lag_x86 *x, int beside, lag_operand of)
{
    if (!of.base) {
        x86_byte(x, 0xC0 | (beside & 7) << 3 | (of.reg & 7));
        return;
    }
    const int small = of.bytes >= -128 && of.bytes < 128;
    x86_byte(x, (small ? 0x40 : 0x80) | (beside & 7) << 3 | (of.indexed ? 4 : of.base));
    if (of.indexed)
        x86_byte(x, X86_RAX << 3 | of.base);
    if (small)
        x86_byte(x, of.bytes);
    else
        x86_word(x, of.bytes);
}

/* to = from (instruction) of, on four numbers if `wide`; `from` is 0 where there is none. An immediate operand is
 * written after it. */
static inline void x86_vex(lag_x86 *x, lag_instruction i, int wide, int to, int from, lag_operand of)
{
    const int last = (~from & 15) << 3 | (wide ? 4 | i.packed : i.scalar), high = !of.base && of.reg > 7;
    if (i.map == 1 && !high) {
        x86_byte(x, 0xC5);
        x86_byte(x, (to < 8) << 7 | last);
    } else {
        x86_byte(x, 0xC4);
        x86_byte(x, (to < 8) << 7 | 0x40 | !high << 5 | i.map);
        x86_byte(x, last);
    }
    x86_byte(x, i.opcode);
    x86_operand(x, to, of);
}

/* Clear the upper halves of all registers: code of the C library may be slow otherwise. */
static inline void x86_narrow(lag_x86 *x)
{
    x86_byte(x, 0xC5);
    x86_byte(x, 0xF8);
    x86_byte(x, 0x77);
}

static inline void x86_push(lag_x86 *x, int reg)
{
    x86_byte(x, 0x50 | reg);
}

static inline void x86_pop(lag_x86 *x, int reg)
{
    x86_byte(x, 0x58 | reg);
}

/* reg += bytes: of RAX, or of RSP. */
static inline void x86_add(lag_x86 *x, int reg, int32_t bytes)
{
    x86_byte(x, 0x48);
    x86_byte(x, 0x81);
    x86_byte(x, 0xC0 | reg);
    x86_word(x, bytes);
}

static inline void x86_set_index(lag_x86 *x, int32_t bytes)
{
    x86_byte(x, 0x48);
    x86_byte(x, 0xC7);
    x86_byte(x, 0xC0 | X86_RAX);
    x86_word(x, bytes);
}

/* Jump back while the last sum was not zero. */
static inline void x86_loop(lag_x86 *x, const uint8_t *start)
{
    x86_byte(x, 0x0F);
    x86_byte(x, 0x85);
    x86_word(x, (int32_t)(start - (x->at + 4)));
}

/* reg = the address of a place in memory. */
static inline void x86_address(lag_x86 *x, int reg, lag_operand of)
{
    x86_byte(x, reg > 7 ? 0x4C : 0x48);
    x86_byte(x, 0x8D);
    x86_operand(x, reg, of);
}

/* reg = another plus bytes. */
static inline void x86_sum(lag_x86 *x, int reg, int from, int32_t bytes)
{
    x86_address(x, reg, (lag_operand){.base = (int8_t)from, .bytes = bytes});
}

/* Call the function at an address, by way of RAX. */
static inline void x86_call(lag_x86 *x, uint64_t address)
{
    x86_byte(x, 0x48);
    x86_byte(x, 0xB8 | X86_RAX);
    memcpy(x->at, &address, sizeof address);
    x->at += sizeof address;
    x86_byte(x, 0xFF);
    x86_byte(x, 0xD0 | X86_RAX);
}

static inline void x86_return(lag_x86 *x)
{
    x86_byte(x, 0xC3);
}

#endif
