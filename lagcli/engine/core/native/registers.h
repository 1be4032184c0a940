/*
 * Values in the sixteen floating-point registers: where one is needed and none is free, the value that is used last
 * gives way. A value is written to memory once: to its place if it must come there, or to a free slot of the frame.
 */
#ifndef LAGCLI_NATIVE_REGISTERS_H
#define LAGCLI_NATIVE_REGISTERS_H

#include "native/flow.h"
#include "native/x86.h"

enum { LAG_NO_REGISTER = -1, LAG_XMM = 16 };
enum { LAG_BIAS = 128 }; /* bytes from where memory begins to where its base register points: short addresses */

typedef struct {
    lag_x86 code;
    const lag_flow *flow;
    int wide;                          /* registers hold four numbers */
    int32_t now;                       /* place of the operation in the order */
    int32_t *next;                     /* by value: where it is used next */
    int8_t *in;                        /* by value: its register */
    uint8_t *saved;                    /* by value: whether it is in memory */
    int32_t *slot;                     /* by value: of the frame, or -1 */
    int32_t holds[LAG_XMM];            /* by register: its value */
    int32_t *free_slots, free_count, slots;
    int32_t released[3];               /* slots that are free after the present operation, which may read them */
    int released_count;
    int32_t *pending, pending_count;   /* values that come to their place at the end of the segment */
} lag_registers;

/* Returns 0, or 1 where there is no memory. */
int lag_registers_begin(lag_registers *r, lag_pool *pool, const lag_flow *flow, int wide, int32_t first_slot);

/* Where a place of the register file, or a slot, is in memory. */
lag_operand lag_at_place(int32_t place);
lag_operand lag_at_slot(int32_t slot);

/* Where a value is in memory. */
lag_operand lag_at_home(const lag_registers *r, int32_t value);

/* Begin the operation at a place in the order. */
void lag_begin_operation(lag_registers *r, int32_t now);

/* A free register, none of those in the set `pinned`. */
int lag_take_register(lag_registers *r, unsigned pinned);

/* The register of a value, which is loaded if it has none; it is added to `pinned`. */
int lag_in_register(lag_registers *r, int32_t value, unsigned *pinned);

/* A value as an operand: from memory, if it is not in a register and not used again soon. */
lag_operand lag_as_operand(lag_registers *r, int32_t value, int32_t later, unsigned *pinned);

/* An operand of the present operation has been read: it is used later, or never. */
void lag_used(lag_registers *r, int32_t value, int32_t later);

/* A register has got the value of a result that is used first at a place in the order. */
void lag_defined(lag_registers *r, int32_t value, int reg, int32_t first);

/* A place in memory for a result that a function writes; it is then the value's. */
lag_operand lag_defined_in_memory(lag_registers *r, int32_t value, int32_t first);

/* Write all values that are used later to memory; forget what registers hold. */
void lag_save_all(lag_registers *r);
void lag_forget_all(lag_registers *r);

/* End a segment: write values to their places. */
void lag_end_segment(lag_registers *r);

#endif
