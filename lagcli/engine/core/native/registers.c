#include "native/registers.h"

#define REACH 24 /* operations: a value that is used again within them is loaded */

int lag_registers_begin(lag_registers *r, lag_pool *pool, const lag_flow *flow, int wide, int32_t first_slot)
{
    const size_t values = (size_t)flow->values;
    r->flow = flow;
    r->wide = wide;
    r->slots = first_slot;
    r->next = flow->use;
    r->in = lag_get(pool, values, 1);
    r->saved = lag_get(pool, values, 1);
    r->slot = lag_get(pool, values, sizeof *r->slot);
    r->free_slots = lag_get(pool, values, sizeof *r->free_slots);
    r->pending = lag_get(pool, values, sizeof *r->pending);
    if (pool->failed)
        return 1;
    memset(r->in, LAG_NO_REGISTER, values);
    memset(r->slot, -1, values * sizeof *r->slot);
    memset(r->saved, 1, (size_t)flow->places);
    for (int k = 0; k < LAG_XMM; ++k)
        r->holds[k] = LAG_NO_VALUE;
    return 0;
}

lag_operand lag_at_place(int32_t place)
{
    return (lag_operand){.base = X86_RBX, .bytes = place * 8 - LAG_BIAS};
}

lag_operand lag_at_slot(int32_t slot)
{
    return (lag_operand){.base = X86_RBP, .bytes = slot * 8 - LAG_BIAS};
}

lag_operand lag_at_home(const lag_registers *r, int32_t value)
{
    return r->slot[value] < 0 ? lag_at_place(r->flow->place[value]) : lag_at_slot(r->slot[value]);
}

static void new_slot(lag_registers *r, int32_t value)
{
    if (r->free_count) {
        r->slot[value] = r->free_slots[--r->free_count];
        return;
    }
    r->slot[value] = r->slots;
    r->slots += r->wide ? 4 : 1;
}

static int is_pending(const lag_registers *r, int32_t value)
{
    return r->flow->kept[value] && r->flow->late[value];
}

/* Write a value to memory from its register. */
static void save(lag_registers *r, int32_t value)
{
    if (r->saved[value])
        return;
    r->saved[value] = 1;
    if (!r->flow->kept[value] || is_pending(r, value))
        new_slot(r, value);
    x86_vex(&r->code, X86_STORE, r->wide, r->in[value], 0, lag_at_home(r, value));
}

static void forget(lag_registers *r, int reg)
{
    if (r->holds[reg] != LAG_NO_VALUE)
        r->in[r->holds[reg]] = LAG_NO_REGISTER;
    r->holds[reg] = LAG_NO_VALUE;
}

void lag_begin_operation(lag_registers *r, int32_t now)
{
    while (r->released_count)
        r->free_slots[r->free_count++] = r->released[--r->released_count];
    r->now = now;
}

int lag_take_register(lag_registers *r, unsigned pinned)
{
    int best = 0;
    int32_t farthest = -1;
    for (int k = 0; k < LAG_XMM; ++k) {
        if (pinned >> k & 1)
            continue;
        if (r->holds[k] == LAG_NO_VALUE)
            return k;
        if (r->next[r->holds[k]] > farthest) {
            farthest = r->next[r->holds[k]];
            best = k;
        }
    }
    save(r, r->holds[best]);
    forget(r, best);
    return best;
}

static void put(lag_registers *r, int32_t value, int reg)
{
    r->holds[reg] = value;
    r->in[value] = (int8_t)reg;
}

int lag_in_register(lag_registers *r, int32_t value, unsigned *pinned)
{
    int reg = r->in[value];
    if (reg < 0) {
        reg = lag_take_register(r, *pinned);
        x86_vex(&r->code, X86_LOAD, r->wide, reg, 0, lag_at_home(r, value));
        put(r, value, reg);
    }
    *pinned |= 1u << reg;
    return reg;
}

lag_operand lag_as_operand(lag_registers *r, int32_t value, int32_t later, unsigned *pinned)
{
    if (r->in[value] < 0 && later - r->now > REACH)
        return lag_at_home(r, value);
    return x86_register(lag_in_register(r, value, pinned));
}

void lag_used(lag_registers *r, int32_t value, int32_t later)
{
    r->next[value] = later;
    if (later != LAG_NEVER || is_pending(r, value))
        return;
    if (r->in[value] >= 0)
        forget(r, r->in[value]);
    if (r->slot[value] >= 0) {
        r->released[r->released_count++] = r->slot[value];
        r->slot[value] = -1;
    }
}

/* What holds of all results. */
static void define(lag_registers *r, int32_t value, int32_t first)
{
    r->next[value] = first;
    if (is_pending(r, value))
        r->pending[r->pending_count++] = value;
}

void lag_defined(lag_registers *r, int32_t value, int reg, int32_t first)
{
    define(r, value, first);
    put(r, value, reg);
    if (r->flow->kept[value] && !r->flow->late[value])
        save(r, value);
    if (first == LAG_NEVER && !is_pending(r, value))
        forget(r, reg);
}

lag_operand lag_defined_in_memory(lag_registers *r, int32_t value, int32_t first)
{
    define(r, value, first);
    r->saved[value] = 1;
    if (!r->flow->kept[value] || is_pending(r, value))
        new_slot(r, value);
    return lag_at_home(r, value);
}

void lag_save_all(lag_registers *r)
{
    for (int k = 0; k < LAG_XMM; ++k) {
        const int32_t value = r->holds[k];
        if (value != LAG_NO_VALUE && (r->next[value] != LAG_NEVER || is_pending(r, value)))
            save(r, value);
    }
}

void lag_forget_all(lag_registers *r)
{
    for (int k = 0; k < LAG_XMM; ++k)
        forget(r, k);
}

void lag_end_segment(lag_registers *r)
{
    for (int32_t i = 0; i < r->pending_count; ++i) {
        const int32_t value = r->pending[i];
        unsigned pinned = 0;
        const int reg = lag_in_register(r, value, &pinned);
        x86_vex(&r->code, X86_STORE, r->wide, reg, 0, lag_at_place(r->flow->place[value]));
        r->saved[value] = 1;
        if (r->slot[value] >= 0) {
            r->free_slots[r->free_count++] = r->slot[value];
            r->slot[value] = -1;
        }
        r->flow->late[value] = 0;
        if (r->next[value] == LAG_NEVER)
            forget(r, reg);
    }
    r->pending_count = 0;
}
