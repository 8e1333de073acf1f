//! Every format reads what it wrote, every reader survives damage, and files of other programs read as they should.

mod formats {
    mod corpus;
    mod damage;
    mod parts;
    mod round_trip;
}
