// One atomic addition a subgroup: its fragments take consecutive nodes. Helper invocations vote no, since what
// they write to memory is lost: their sample mask is 0, unless a forced depth test made them helpers.

fn hand_out(kept: bool) -> u32 {
    let votes = subgroupBallot(kept);
    let own = subgroupExclusiveAdd(u32(kept));
    let bits = countOneBits(votes);
    let total = bits.x + bits.y + bits.z + bits.w;
    var first = 0u;
    if kept && own == 0u {
        first = take(total);
    }
    // Only one invocation has a first node that is not 0.
    return subgroupMax(first) + own;
}
