// SPDX-License-Identifier: MIT
/* Whether the pose is in doubt: each arrow of docs/SUPERVISION.md, and no other. And the table of limits. */
#include <string.h>
#include <unity.h>

#include "limits/limits.h"
#include "supervise/doubt.h"

enum { STATES = PLR_DOUBT_SETTLING + 1, EVENTS = PLR_DOUBT_SETTLES + 1 };

static void test_every_event_leads_where_it_should_from_every_doubt(void) {
    enum { NONE, DEPARTED, CONTRADICTED, SETTLING };
    /* contradicts, departs, returns, loses, settles */
    static const uint8_t to[STATES][EVENTS] = {
        [NONE] = {CONTRADICTED, DEPARTED, NONE, SETTLING, NONE},
        [DEPARTED] = {CONTRADICTED, DEPARTED, SETTLING, DEPARTED, DEPARTED},
        [CONTRADICTED] = {CONTRADICTED, CONTRADICTED, CONTRADICTED, CONTRADICTED, NONE},
        [SETTLING] = {CONTRADICTED, DEPARTED, SETTLING, SETTLING, NONE},
    };
    for (unsigned from = 0; from < STATES; from++)
        for (unsigned event = 0; event < EVENTS; event++) {
            plr_supervisor s = {.doubt = (uint8_t)from};
            plr_doubt_change(&s, (plr_doubt_event)event);
            TEST_ASSERT_EQUAL_UINT8(to[from][event], s.doubt);
            TEST_ASSERT_EQUAL(to[from][event] == CONTRADICTED, plr_doubt_contradicted(&s));
        }
}

static const plr_limit_row *row_named(const char *name) {
    for (unsigned i = 0; i < PLR_LIMITS; i++)
        if (strcmp(plr_limit_at(i)->name, name) == 0)
            return plr_limit_at(i);
    return NULL;
}

static void test_rules_have_a_bit_each_and_limits_a_name_of_their_own_and_a_reason(void) {
    TEST_ASSERT_LESS_OR_EQUAL_UINT(64, PLR_RULES);
    for (unsigned i = 0; i < PLR_LIMITS; i++) {
        const plr_limit_row *row = plr_limit_at(i);
        TEST_ASSERT_GREATER_THAN_UINT(5, strlen(row->about));
        TEST_ASSERT_EQUAL_PTR(row, row_named(row->name));
    }
    TEST_ASSERT_NULL(plr_limit_at(PLR_LIMITS));
}

static void test_what_is_no_rule_belongs_to_one(void) {
    for (unsigned i = 0; i < PLR_LIMITS; i++) {
        const plr_limit_row *row = plr_limit_at(i), *rule;
        TEST_ASSERT_EQUAL(i >= PLR_RULES, row->rule != NULL);
        if (!row->rule)
            continue;
        rule = row_named(row->rule);
        TEST_ASSERT_NOT_NULL_MESSAGE(rule, row->name);
        TEST_ASSERT_NULL_MESSAGE(rule->rule, row->name);
    }
}

static void test_a_rule_that_is_left_out_has_its_other_value_and_no_other_has(void) {
    for (unsigned i = 0; i < PLR_RULES; i++) {
        const uint64_t left_out = (uint64_t)1 << i;
        for (unsigned k = 0; k < PLR_LIMITS; k++) {
            const plr_limit_row *row = plr_limit_at(k);
            const double due = k == i ? row->off : row->value;
            TEST_ASSERT_EQUAL_DOUBLE((double)(plr_real)due,
                                     (double)plr_limit(left_out, (plr_limit_id)k));
        }
    }
}
