-- The schema of version 11 on PostgreSQL: as db/migrations/0011_station_claims.sql, which has the reasons.
CREATE TABLE station_claims (
  station       TEXT COLLATE "C" PRIMARY KEY REFERENCES stations (name),
  epoch         BIGINT NOT NULL CHECK (epoch > 0),
  server        TEXT COLLATE "C" NOT NULL,
  since_unix_ns BIGINT NOT NULL
);
