// One atomic addition a subgroup: its fragments take consecutive nodes. Helper invocations vote no, since what
// they write to memory is lost: their sample mask is 0, unless a forced depth test made them helpers.

var<private> own_lane: u32;

fn hand_out(kept: bool) -> u32 {
    let votes = subgroupBallot(kept);
    let counts = countOneBits(votes);
    let words = vec4u(0u, 1u, 2u, 3u);
    let own_word = own_lane / 32u;
    let lower = countOneBits(votes & vec4u((1u << (own_lane % 32u)) - 1u));
    // Of the own word the bits below, of the words before all.
    let each = select(vec4u(0u), counts, words < vec4u(own_word)) + select(vec4u(0u), lower, words == vec4u(own_word));
    let before = each.x + each.y + each.z + each.w;
    var first = 0u;
    if kept && before == 0u {
        first = take(counts.x + counts.y + counts.z + counts.w);
    }
    // From the first that voted; 0 where none did.
    let trailing = firstTrailingBit(votes) + 32u * words;
    var leader = select(0u, trailing.w, votes.w != 0u);
    leader = select(leader, trailing.z, votes.z != 0u);
    leader = select(leader, trailing.y, votes.y != 0u);
    leader = select(leader, trailing.x, votes.x != 0u);
    return subgroupShuffle(first, leader) + before;
}
