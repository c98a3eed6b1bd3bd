/* A step of the IDM, vehicle by vehicle over the rows: `accelerate` and `move` of
 * tests/unit/minisim/engine/oracle.py, and the functions that they call of minisim/laws.py and
 * minisim/carfollowing.py, where units and sources are. SI units; equal to them in every bit.
 * scalar.py writes records.h: `Vehicle`, `Lane`, `Type` and `Law` as minisim has them. */

#include "records.h"
#include <math.h>
#include <stdbool.h>
#include <time.h>

enum { DRIVING = 1 };
static const double HALTING = 0.1, STOP_MARGIN = 0.25;

typedef struct { double exit, length, exit_arm, start; } Ends;

/* The arrays of a run, those of paths as in minisim.engine.state.Layout. All fields have 8 bytes. */
typedef struct {
    Vehicle *vehicles;
    const Lane *lanes;
    const Law *law;
    const Ends *ends;             /* (paths) */
    const double *start, *speed;  /* (paths, sections) */
    const double *branch;         /* (paths, paths) */
    const Type *types;
    int64_t lane_count, paths, sections;
} World;

static inline double least(double x, double y) { return y < x ? y : x; }
static inline double most(double x, double y) { return y > x ? y : x; }

/* minisim/carfollowing.py */

static inline double gap_ratio(double v, double gap, double v_leader, const Type *me)
{
    if (gap <= 0.0)
        return INFINITY;
    const double dynamic = v * me->headway + v * (v - v_leader) / me->root;
    return (me->min_gap + (dynamic > 0.0 ? dynamic : 0.0)) / gap;
}

static inline double free_road(double r, const Type *me)
{
    const double power = me->delta == 4.0 ? (r * r) * (r * r) : pow(r, me->delta);
    return most(me->a * (1.0 - power), -me->b);
}

static inline double speed_towards(double v, double target, double distance, double b, double dt)
{
    const double half = 0.5 * b * dt;
    const double disc = half * half + target * target + 2.0 * b * distance - b * dt * v;
    return disc < 0.0 ? v - b * dt : sqrt(disc) - half;
}

static inline double stop_within(double v, double distance, double b, double dt)
{
    if (v * dt > 2.0 * distance)
        return -v * v / (2.0 * most(distance, 1e-9));
    return (speed_towards(v, 0.0, distance, b, dt) - v) / dt;
}

/* minisim/laws.py */

static inline double room_behind(double gap, double v_leader, double b_leader, const Type *me,
                                 const Law *law)
{
    double squared = v_leader * v_leader;
    if (b_leader > me->b_max)
        squared *= me->b_max / b_leader;
    return 2.0 * me->b_max * (gap - law->room) + squared;
}

static inline bool short_of(double room, double v, double v_new, const Type *me, const Law *law)
{
    const double top = v_new > v ? v_new : v;
    return top * (top + 2.0 * me->b_max * law->dt) > room;
}

static inline double keep_room(double v, double room, const Type *me, const Law *law)
{
    return stop_within(v, room / (2.0 * me->b_max), me->b_max, law->dt);
}

static inline double within(double v, double acc, double limit, const Law *law)
{
    return v < limit && limit < v + acc * law->dt ? (limit - v) / law->dt : acc;
}

static inline double follow(double v, double v0, double z, const Type *me)
{
    const double free = v0 <= 0.0 ? -me->b : free_road(v / v0, me);
    return free - me->a * z * z;
}

static inline double drive(double v, double limit, double advice, double z, const Type *me,
                           const Law *law)
{
    const double acc = within(v, follow(v, limit, z, me), limit, law);
    if (advice >= limit)
        return acc;
    const double told = within(v, follow(v, advice, z, me), advice, law);
    return least(acc, most(told, -me->b));
}

static inline double obey(double told, double v, double limit, double z, const Type *me,
                          const Law *law)
{
    const double asked = v == 0.0 ? most(told, 0.0) : told;
    const double acc = least(asked, follow(v, INFINITY, z, me));
    if (v + acc * law->dt > limit)
        return least(acc, most((limit - v) / law->dt, -me->b));
    return acc;
}

static inline bool braking_begins(double v, double distance, const Type *me, const Law *law)
{
    return 2.0 * me->b * distance <= v * v + 4.0 * me->b * v * law->dt;
}

static inline double slow_down(double v, double acc, double target, double distance,
                               const Type *me, const Law *law)
{
    if (v + acc * law->dt <= target)
        return acc;
    const double v_new = most(speed_towards(v, target, distance, me->b, law->dt), target);
    return most((v_new - v) / law->dt, -me->b);
}

static inline double hold(double v, double s, const Type *me, const Law *law)
{
    const double distance = law->hold - s - STOP_MARGIN;
    if (v * v <= 2.0 * me->b * distance) {
        if (v == 0.0 && distance < 1e-3)
            return 0.0;
        const double v_new = speed_towards(v, 0.0, distance, me->b, law->dt);
        return v_new > 0.0 ? (v_new - v) / law->dt : -v * v / (2.0 * most(distance, 1e-6));
    }
    const double to_junction = law->entry - s;
    if (v * v <= 2.0 * me->b * to_junction)
        return -me->b;
    return -v * v / (2.0 * most(to_junction - STOP_MARGIN, 1e-6));
}

/* oracle.py */

/* Whether the rear of `ahead`, at `rear`, is still on path p. */
static inline bool shares(const Vehicle *ahead, double rear, int64_t p, const World *world)
{
    return ahead->status == DRIVING && rear < world->branch[ahead->path * world->paths + p];
}

/* Choose the acceleration of row i from the present state; returns whether it overlaps another. */
static inline bool accelerate(World *world, const Lane *lane, int64_t i)
{
    Vehicle *vehicles = world->vehicles, *me = vehicles + i;
    const Law *law = world->law;
    const Type *mine = world->types + me->type;
    const int64_t p = me->path;
    const Ends ends = world->ends[p];
    const double s = me->s, v = me->v;
    const bool released = lane->open || me->go;
    bool overlap = false;

    /* The vehicle ahead in the lane, until its rear has left the shared path. */
    double z = 0.0, room = INFINITY;
    int64_t j = i - 1;
    for (; j >= lane->first; j--) {
        const Vehicle *ahead = vehicles + j;
        const double rear = ahead->s - ahead->length;
        if (shares(ahead, rear, p, world)) {
            z = gap_ratio(v, rear - s, ahead->v, mine);
            room = room_behind(rear - s, ahead->v, ahead->b_max, mine, law);
            overlap |= rear <= s;
            break;
        }
        if (s >= ends.exit)
            break;
    }

    /* A vehicle that cannot stop before the junction sees past a leader that may turn off. */
    const bool near = s < ends.exit && v * v > 2.0 * mine->b_max * (law->entry - s);
    if (near)
        for (j = (lane->front < j ? lane->front : j) - 1; j >= lane->first; j--) {
            const Vehicle *ahead = vehicles + j;
            const double rear = ahead->s - ahead->length;
            if (shares(ahead, rear, p, world))
                room = least(room, room_behind(rear - s, ahead->v, ahead->b_max, mine, law));
        }

    /* From the junction on, also the last vehicle ahead bound for the same exit lane. */
    j = -1;
    if (s >= law->entry)
        j = me->ahead;
    else if (released && (i == lane->front || near))
        j = world->lanes[(int64_t)ends.exit_arm].last;
    if (j >= 0 && vehicles[j].status == DRIVING) {
        const Vehicle *ahead = vehicles + j;
        const double rear = ahead->s - ahead->length - world->ends[ahead->path].exit;
        const double gap = rear - (s - ends.exit);
        if (s >= law->entry || i == lane->front)
            z = most(z, gap_ratio(v, gap, ahead->v, mine));
        if (rear >= 0.0)
            room = least(room, room_behind(gap, ahead->v, ahead->b_max, mine, law));
        overlap |= gap <= 0.0 && s >= ends.exit;
    }

    const int64_t section = p * world->sections + me->section;
    const double *start = world->start + section, *speed = world->speed + section;
    const double limit = speed[0] * me->factor;
    double acc = me->told < INFINITY
        ? obey(me->told, v, least(limit, me->advice), z, mine, law)
        : drive(v, limit, me->advice, z, mine, law);
    for (int k = 1; braking_begins(v, start[k] - s, mine, law); k++)
        acc = least(acc, slow_down(v, acc, speed[k] * me->factor, start[k] - s, mine, law));
    if (!released && s < law->entry)
        acc = least(acc, hold(v, s, mine, law));
    if (short_of(room, v, v + acc * law->dt, mine, law))
        acc = least(acc, keep_room(v, room, mine, law));
    const double brake = v > 0.0 ? me->brake : most(me->brake, 0.0);
    me->a = most(least(acc, brake), -mine->b_max);
    return overlap;
}

/* Move a vehicle by one step, and add up waiting and loss. */
static inline void move(Vehicle *me, const World *world)
{
    const double dt = world->law->dt;
    const double v = me->v + me->a * dt;
    me->s = v < 0.0 ? me->s - me->v * me->v / (2.0 * me->a)
                    : me->s + me->v * dt + 0.5 * me->a * dt * dt;
    me->v = v < 0.0 ? 0.0 : v;
    me->waiting_ticks += me->v <= HALTING;
    const int64_t first = me->path * world->sections;
    while (me->s >= world->start[first + me->section + 1])
        me->section++;
    const double allowed = world->speed[first + me->section] * me->factor;
    if (me->v < allowed)
        me->lost_ticks += 1.0 - me->v / allowed;
}

/* Take so many steps; returns whether two vehicles overlapped. */
bool take(World *world, int steps)
{
    const Lane *end = world->lanes + world->lane_count;
    bool overlap = false;
    while (steps-- > 0) {
        for (const Lane *lane = world->lanes; lane < end; lane++)
            for (int64_t i = lane->first; i < lane->next; i++)
                if (world->vehicles[i].status == DRIVING)
                    overlap |= accelerate(world, lane, i);
        for (const Lane *lane = world->lanes; lane < end; lane++)
            for (int64_t i = lane->first; i < lane->next; i++)
                if (world->vehicles[i].status == DRIVING)
                    move(world->vehicles + i, world);
    }
    return overlap;
}

/* Seconds that so many steps take, after one that brings the vehicles into the cache. */
double timed(World *world, int steps)
{
    take(world, 1);
    const clock_t start = clock();
    take(world, steps);
    return (double)(clock() - start) / CLOCKS_PER_SEC;
}
