// SPDX-License-Identifier: MIT
/* The campaign: many seeded drives of the filter through a simulated world, and what they come to
 * beside the limits that the project sets itself. docs/TESTING.md, "The campaign". */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "campaign/pool.h"
#include "campaign/scenario.h"
#include "campaign/table.h"
#include "campaign/whole_number.h"
#include "pelorus/pelorus.h"

typedef struct options {
    const char *wanted;  /* names with commas; NULL: all */
    const char *changes; /* to what was chosen */
    uint64_t left_out;   /* rules of the supervisor: plr_filter_leave_out */
    const char *policy;
    unsigned long seeds, first_seed, jobs, parked_frames;
    bool list, gate;
} options;

enum { SHORT_SEEDS = 4, SEEDS = 30, LONG_SEEDS = 300 };
enum { SHORT_PARKED = 3000, PARKED = 20000, LONG_PARKED = 100000 };

static void usage(FILE *out) {
    fputs("usage: pelorus-campaign [options]\n"
          "  --list                what there is\n"
          "  --limits              the supervisor's thresholds\n"
          "  --without NAME,...    leaves out these\n"
          "  --policy NAME         own: only what each scenario is judged by; stands or may-move: "
          "by\n"
          "                        that instead (both: the other one's rows stand below)\n"
          "  --scenario NAME,...   only these; a name that ends with * means all that begin so\n"
          "  --seeds N             drives of each scenario (30)\n"
          "  --first-seed N        (1)\n"
          "  --jobs N              processes (as many as processors)\n"
          "  --parked-frames N     length of the parked scenarios (20000)\n"
          "  --short               4 seeds, 3000 parked frames, --policy own\n"
          "  --long                300 seeds, 100000 parked frames\n"
          "  --set NAME=VALUE,...  change the scenarios; the limits are not meant for that\n"
          "  --gate                exit status 1 if a limit is not met\n"
          "example: pelorus-campaign --scenario mc-low,'slip*' --seeds 100\n",
          out);
}

static void refuse(const char *option, const char *value) {
    fprintf(stderr, "pelorus-campaign: %s %s: %s\n", option, value ? value : "",
            value ? "not what this option takes" : "needs a value, or is no option");
    usage(stderr);
    exit(2);
}

static unsigned long number(const char *option, const char *text) {
    const unsigned long n = whole_number(text, 100000000);
    if (n == 0)
        refuse(option, text);
    return n;
}

static bool take_number(options *o, const char *option, const char *value) {
    static const char *const names[] = {"--seeds", "--first-seed", "--jobs", "--parked-frames"};
    unsigned long *const targets[] = {&o->seeds, &o->first_seed, &o->jobs, &o->parked_frames};
    for (unsigned i = 0; i < sizeof names / sizeof names[0]; i++)
        if (strcmp(option, names[i]) == 0) {
            *targets[i] = number(option, value);
            return true;
        }
    return false;
}

static void list_limits(void) {
    for (unsigned i = 0; i < PLR_RULES; i++)
        printf("%-20s %8g %s: %s\n", plr_limit_at(i)->name, plr_limit_at(i)->value,
               plr_limit_at(i)->unit, plr_limit_at(i)->about);
}

static uint64_t limits_named(const char *names) {
    uint64_t found = 0;
    for (const char *name = names; *name;) {
        const size_t length = strcspn(name, ",");
        unsigned row = 0;
        while (plr_limit_at(row) && (strlen(plr_limit_at(row)->name) != length ||
                                     memcmp(plr_limit_at(row)->name, name, length) != 0))
            row++;
        if (!plr_limit_at(row) || plr_limit_at(row)->rule)
            refuse("--without", names);
        found |= UINT64_C(1) << row;
        name += length + (name[length] == ',');
    }
    return found;
}

static const char *policy_named(const char *name) {
    static const char *const names[] = {"both", "own", "stands", "may-move"};
    for (unsigned i = 0; i < sizeof names / sizeof names[0]; i++)
        if (strcmp(name, names[i]) == 0)
            return names[i];
    refuse("--policy", name);
    return NULL;
}

static options parse(int argc, char **argv) {
    options o = {NULL, "", 0, "both", SEEDS, 1, pool_processors(), PARKED, false, false};
    for (int i = 1; i < argc; i++) {
        const char *option = argv[i], *value = i + 1 < argc ? argv[i + 1] : NULL;
        if (strcmp(option, "--list") == 0) {
            o.list = true;
        } else if (strcmp(option, "--limits") == 0) {
            list_limits();
            exit(0);
        } else if (strcmp(option, "--without") == 0 && value) {
            o.left_out = limits_named(argv[++i]);
        } else if (strcmp(option, "--policy") == 0 && value) {
            o.policy = policy_named(argv[++i]);
        } else if (strcmp(option, "--gate") == 0) {
            o.gate = true;
        } else if (strcmp(option, "--short") == 0) {
            o.seeds = SHORT_SEEDS;
            o.policy = "own";
            o.parked_frames = SHORT_PARKED;
        } else if (strcmp(option, "--long") == 0) {
            o.seeds = LONG_SEEDS;
            o.parked_frames = LONG_PARKED;
        } else if (strcmp(option, "--help") == 0) {
            usage(stdout);
            exit(0);
        } else if (strcmp(option, "--scenario") == 0 && value) {
            o.wanted = argv[++i];
        } else if (strcmp(option, "--set") == 0 && value) {
            o.changes = argv[++i];
        } else if (take_number(&o, option, value)) {
            i++;
        } else {
            refuse(option, NULL);
        }
    }
    return o;
}

/* Does a name match the pattern's first `length` characters? */
static bool matches(const char *name, const char *pattern, size_t length) {
    if (length > 0 && pattern[length - 1] == '*')
        return strncmp(name, pattern, length - 1) == 0;
    return strlen(name) == length && memcmp(name, pattern, length) == 0;
}

/* Marks the scenarios that are wanted; a name that matches none ends the program. */
static unsigned choose(const char *wanted, bool *chosen) {
    unsigned n = 0;
    for (const char *name = wanted; name && *name;) {
        const size_t length = strcspn(name, ",");
        bool found = false;
        for (unsigned i = 0; i < scenario_count; i++)
            if (matches(scenarios[i].name, name, length))
                chosen[i] = found = true;
        if (!found) {
            fprintf(stderr, "pelorus-campaign: no scenario %.*s; --list shows them\n", (int)length,
                    name);
            exit(2);
        }
        name += length + (name[length] == ',');
    }
    for (unsigned i = 0; i < scenario_count; i++)
        n += chosen[i] |= !wanted;
    return n;
}

static void list(void) {
    for (unsigned i = 0; i < scenario_count; i++)
        printf("%-18s %s\n", scenarios[i].name, scenarios[i].about);
}

typedef struct task {
    const scenario *s;
    uint64_t seed;
    uint8_t scene;
} task;

typedef struct campaign {
    task *tasks;
    outcome *outcomes;
    drive_options options;
} campaign;

static void drive_one(void *context, unsigned index) {
    const campaign *c = context;
    const task *t = &c->tasks[index];
    drive(t->s, t->seed, t->scene, &c->options, &c->outcomes[index]);
}

static scenario changed(const scenario *original, const char *changes) {
    char names[400];
    scenario s = *original;
    const char *wrong = scenario_change(&s, changes);
    if (wrong) {
        scenario_fields(names, sizeof names);
        fprintf(stderr, "pelorus-campaign: --set: cannot take %s\nto be set: %s\n", wrong, names);
        exit(2);
    }
    return s;
}

/* By which policies a scenario is run, the one that it is judged by first. Without an event both are the same. */
static unsigned scenes_of(const options *o, const scenario *s, uint8_t scenes[2]) {
    scenes[0] = scenario_scene(s);
    if (strcmp(o->policy, "stands") == 0)
        scenes[0] = PLR_SCENE_STANDS;
    else if (strcmp(o->policy, "may-move") == 0)
        scenes[0] = PLR_SCENE_MAY_MOVE;
    scenes[1] = scenes[0] == PLR_SCENE_STANDS ? PLR_SCENE_MAY_MOVE : PLR_SCENE_STANDS;
    return strcmp(o->policy, "both") == 0 && s->during > 0 ? 2 : 1;
}

/* Runs what was chosen, and prints it in the table's order. Returns how many fell short. */
static unsigned run(const options *o, const bool *chosen, unsigned n) {
    const unsigned seeds = (unsigned)o->seeds;
    task *tasks = calloc((size_t)n * seeds * 2, sizeof *tasks);
    outcome *outcomes = pool_shared((size_t)n * seeds * 2 * sizeof *outcomes);
    scenario *copies = calloc(scenario_count, sizeof *copies);
    unsigned filled = 0, failed = 0;
    if (!tasks || !copies) {
        fprintf(stderr, "pelorus-campaign: no memory for %u drives\n", 2 * n * seeds);
        exit(2);
    }
    for (unsigned i = 0; i < scenario_count; i++) {
        uint8_t scenes[2];
        copies[i] = changed(&scenarios[i], o->changes);
        const unsigned times = chosen[i] ? scenes_of(o, &copies[i], scenes) : 0;
        for (unsigned k = 0; k < times * seeds; k++)
            tasks[filled++] = (task){&copies[i], o->first_seed + k % seeds, scenes[k / seeds]};
    }
    campaign c = {tasks, outcomes, {(unsigned)o->parked_frames, o->left_out}};
    pool_run(filled, (unsigned)o->jobs, 0, "drives", drive_one, &c);
    table_heading();
    const scenario *judged = NULL;
    for (unsigned i = 0; i < filled; i += seeds) {
        if (tasks[i].s == judged)
            table_print_other(judged, tasks[i].scene, outcomes + i, seeds);
        else
            failed += !table_print(tasks[i].s, outcomes + i, seeds);
        judged = tasks[i].s;
    }
    free(copies);
    free(tasks);
    return failed;
}

int main(int argc, char **argv) {
    const options o = parse(argc, argv);
    if (o.list) {
        list();
        return 0;
    }
    bool *chosen = calloc(scenario_count, sizeof *chosen);
    if (!chosen)
        return 2;
    const unsigned n = choose(o.wanted, chosen);
    printf("# pelorus %s, float%u, %lu seeds from %lu\n", plr_version(),
           (unsigned)(8 * sizeof(plr_real)), o.seeds, o.first_seed);
    const unsigned failed = run(&o, chosen, n);
    printf("\n%u of %u scenarios meet their limits\n", n - failed, n);
    free(chosen);
    return o.gate && failed ? 1 : 0;
}
