-- Schema version 2. What was done with the syringe in each closed session: needlelab.pb.SyringeEvent, one row each, in order
-- of time. Worked out by the server from the committed samples; a place is that of the needle's opening, in W.
CREATE TABLE session_events (
  session                 INTEGER NOT NULL REFERENCES sessions (number),
  position                INTEGER NOT NULL CHECK (position >= 0),       -- in its session, from 0
  kind                    INTEGER NOT NULL CHECK (kind IN (1, 2)),      -- 1 aspiration, 2 injection
  begin_tick              INTEGER NOT NULL,
  end_tick                INTEGER NOT NULL CHECK (end_tick >= begin_tick),
  begin_s                 REAL NOT NULL,                                -- since the session's first sample
  end_s                   REAL NOT NULL,
  plunger_from            REAL NOT NULL,                                -- 0 drawn out, 1 pressed down
  plunger_to              REAL NOT NULL,
  in_tissue_share         REAL NOT NULL,
  in_target_share         REAL NOT NULL,
  begin_x_m               REAL NOT NULL,
  begin_y_m               REAL NOT NULL,
  begin_z_m               REAL NOT NULL,
  begin_layer             INTEGER NOT NULL CHECK (begin_layer >= -1),   -- from 0; -1 outside the tissue
  begin_tissue            TEXT NOT NULL,
  begin_insertion_m       REAL NOT NULL,
  begin_depth_m           REAL NOT NULL,
  begin_target            TEXT NOT NULL,                                -- the nearest; '' where there is none
  begin_target_distance_m REAL NOT NULL,                                -- from its edge, negative inside
  begin_hazard            TEXT NOT NULL,                                -- the one that it was in, or ''
  end_x_m                 REAL NOT NULL,
  end_y_m                 REAL NOT NULL,
  end_z_m                 REAL NOT NULL,
  end_layer               INTEGER NOT NULL CHECK (end_layer >= -1),
  end_tissue              TEXT NOT NULL,
  end_insertion_m         REAL NOT NULL,
  end_depth_m             REAL NOT NULL,
  end_target              TEXT NOT NULL,
  end_target_distance_m   REAL NOT NULL,
  end_hazard              TEXT NOT NULL,
  hazards                 TEXT NOT NULL,                                -- those met on the way, one a line
  PRIMARY KEY (session, position)
) STRICT, WITHOUT ROWID;

-- How many of them a session has. NULL: not worked out, because it is open or was closed before version 2.
ALTER TABLE sessions ADD COLUMN events INTEGER CHECK (events IS NULL OR events >= 0);
