-- Schema version 11. Which server has a station, where several work on one database: each log-in of the station raises its epoch, and
-- whatever stores something of its sessions asks within its own transaction whether its epoch is still the newest. Without other servers
-- nobody writes a row.
CREATE TABLE station_claims (
  station       TEXT PRIMARY KEY REFERENCES stations (name),
  epoch         INTEGER NOT NULL CHECK (epoch > 0),
  server        TEXT NOT NULL,                        -- its name among the servers
  since_unix_ns INTEGER NOT NULL                      -- by that server's clock
) STRICT, WITHOUT ROWID;
