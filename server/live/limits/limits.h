/// The server's limits in one table: each row has the value, then its unit and reason. Tests use other
/// values. tests/security/limits.tsv lists the attack that each row stops and the test that shows it.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>

namespace needlelab {

/// Places of connections at a port (admission.h).
struct AdmissionLimits {
  std::size_t max_connections = 4096;  ///< connections of the port, logged in or not
  std::size_t newcomers_one_in = 16;   ///< places: one in this many is for connections about to log in
  std::size_t stations_one_in = 4;     ///< places: one in this many is for stations; 0: none
  std::size_t connections_of_account = SIZE_MAX;  ///< logged in; above, the account's own give way
  std::size_t max_strangers = 1536;               ///< connections without log-in, some 60 KiB each
  /// Of those, from addresses that have not logged in before; the rest is reserved for known addresses.
  std::size_t max_strangers_of_unknown = 1280;
  std::size_t strangers_of_address = 1280;  ///< connections: the rest is left for other addresses
  double charges_at_once = 2048;            ///< connections of one address (IPv6: of one /64)
  double charges_at_once_of_known = 8192;   ///< likewise, for an address that has logged in before
  std::chrono::milliseconds refill{20};     ///< one charge is refunded per interval
  std::size_t max_known = 4096;             ///< addresses: above, the one known for longest is dropped
  std::chrono::hours known_for{30 * 24};    ///< after the last log-in there: a lab's long holidays
};

/// For the web port: a browser opens six connections, and a proxy limits its clients itself.
inline constexpr AdmissionLimits kWebAdmission{.max_connections = 512,
                                               .stations_one_in = 0,
                                               .connections_of_account = 64,
                                               .max_strangers = 256,
                                               .max_strangers_of_unknown = 192,
                                               .strangers_of_address = 128,
                                               .charges_at_once = 512,
                                               .charges_at_once_of_known = 2048};

/// TLS handshakes that are computed or half done (handshake_turns.h).
struct HandshakeLimits {
  std::size_t at_once = 8;             ///< turns: answers (0.2 ms each) before other sockets are served
  std::size_t places = 64;             ///< half done, of strangers' addresses together
  std::size_t places_of_known = 64;    ///< likewise, of addresses that have logged in before
  std::size_t places_of_address = 24;  ///< half done; with fewer a lab behind one address reconnects slowly
  /// Longer than a round trip to any station; an address completes at least `places_of_address` in that time.
  std::chrono::milliseconds patience{1000};
};

/// Failed log-ins with a password (login_guard.h).
struct LoginGuardLimits {
  double allowed_per_name = 5;                          ///< failures in a row at an address: typing errors
  std::chrono::milliseconds first_wait{10'000};         ///< after that; doubles with each further failure
  std::chrono::milliseconds longest_wait{15 * 60'000};  ///< so a guesser has some 100 tries a day
  std::chrono::milliseconds quiet{3'600'000};       ///< without a failure; then the count restarts at zero
  double allowed_per_address = 30;                  ///< failures at once, of any name: a class mistypes
  std::chrono::milliseconds refill_address{2'000};  ///< one more
  double allowed_everywhere = 50;                   ///< failures at once of a name, at any address
  std::chrono::milliseconds refill_everywhere{10'000};  ///< one more
  std::size_t max_entries = 10'000;  ///< of each kind; above, the longest idle one is dropped
};

/// Log-ins that wait for their check, 0.1 s each (turn_queue.h).
struct LoginQueueLimits {
  std::size_t places = 64;             ///< log-ins: the last one waits for some 6 s
  std::size_t places_of_unknown = 48;  ///< of those, for unknown people
};

/// Tokens in memory (tokens.h).
struct TokenLimits {
  std::chrono::milliseconds lifetime = std::chrono::minutes(15);  ///< without use
  std::size_t max_tokens = 10'000;  ///< above, the one that expires first is dropped
  std::chrono::milliseconds longest = std::chrono::hours(12);  ///< after the password: a working day
  std::size_t max_of_person = 512;                             ///< above, one of the person's own is dropped
};

/// What a station may store (quotas.h). All but the first are per day.
struct StationLimits {
  /// Sessions open at once: as many as a Welcome names (kMaxWelcomed). A station has one or two.
  std::uint64_t open_sessions = 1000;
  /// Bytes of descriptions with the profile: 6,000 usual sessions of 10 kB.
  double description_bytes = 64.0 * 1024 * 1024;
  /// Trainee names that match no one, for the managers' list: a class of 30 that mistypes for a week.
  double unknown_names = 200;
  /// Bytes of stored chunks. A day and night at 1 kHz are 600 MB, a full spool is 4 GiB.
  double chunk_bytes = 8.0 * 1024 * 1024 * 1024;
  /// Bytes of chunks that cannot be decoded (Appended::quarantined): an honest station has none.
  double undecodable_bytes = 256.0 * 1024 * 1024;
};

/// Bytes that one account may store within a day (quotas.h): far above what people enter by hand.
struct AccountLimits {
  /// Of trainees and researchers: 2,700 of the longest consents.
  double own_bytes = 8.0 * 1024 * 1024;
  /// Of instructors and curriculum managers: 1,000 of the largest profiles and courses, 80,000 usual ones.
  double staff_bytes = 1024.0 * 1024 * 1024;
  double administrator_bytes = 16.0 * 1024 * 1024 * 1024;  ///< of administrators
};

/// Log lines of each kind per account, and for all strangers together (peer_lines.h).
struct LogLimits {
  /// Far more than needed to notice a fault or an attack; at most 50 MB an hour over all kinds.
  std::uint64_t a_minute = 60;
  std::uint64_t answered_a_minute = 300;  ///< of the web port's answers: a page asks some ten times
  std::uint64_t no_room_an_hour = 1;      ///< stations keep asking; the log may share the full disk
};

/// Bytes in use at once (byte_budget.h). Unset members are unlimited.
struct BudgetLimits {
  std::size_t person = SIZE_MAX;   ///< on all connections; at most a quarter of `people`
  std::size_t people = SIZE_MAX;   ///< together; the rest of `server` is for stations
  std::size_t station = SIZE_MAX;  ///< on all connections; at most a quarter of what people leave
  std::size_t server = SIZE_MAX;
};

/// Chunks that wait for their commit, of the whole server.
struct ChunkLimits {
  std::size_t chunks = 8192;       ///< chunks: less than the capacity of the writer's queue
  std::size_t bytes = 128u << 20;  ///< bytes: a lesson's chunk has some 7 kB, a hostile one 1 MiB
};

/// The load from one connection, account or station.
struct ConnectionBounds {
  /// Uncommitted chunks of a station over all its connections. At the limit the connections are not read.
  std::size_t chunks_in_flight = 64;
  std::size_t chunk_bytes_in_flight = 8u << 20;  ///< bytes of them
  ChunkLimits all_chunks_in_flight;
  std::size_t requests_at_work = 8;  ///< of a connection; at the limit it is not read
  /// Passwords and codes of a station or person that wait for hashing, 0.1 s each; at the limit as for
  /// `requests_at_work`.
  std::size_t hashes_waiting = 8;
  /// Sessions that a station closes at once over all its connections; normally two or three. Further ones are
  /// refused (RATE_LIMITED) and retried.
  std::size_t closes_of_station = 8;
  LoginQueueLimits logins;
  LogLimits log_lines;                      ///< on both ports
  std::size_t connections_of_person = 256;  ///< logged in at once
  /// Messages of a station or person over all connections. Excludes chunks and requests, which have their own
  /// limits.
  double small_messages_at_once = 5000;
  double small_messages_per_s = 500;  ///< messages per second after that
  /// Bytes of a ClockOffset, CloseSession, Ping, Pong, Subscribe or Unsubscribe. Longer ones are refused
  /// unparsed, so waiting closes use little memory.
  std::size_t small_message_bytes = 4u << 10;
  std::size_t refusals = 200;  ///< refused messages after log-in, then the connection ends
  /// For a station to confirm an instructor's message; then the instructor gets an error.
  std::chrono::milliseconds confirm_timeout{5'000};
  std::size_t known_sessions = 1024;  ///< sessions of a connection with watermarks in memory
  /// Bytes that need parsing one by one; a message with more is parsed on another thread. These take some 50
  /// µs here.
  std::size_t parsed_here_bytes = 16u << 10;
  /// Bytes: messages that decode to no more than this do not count in the budget; `requests_at_work` and
  /// `closes_of_station` limit them.
  std::size_t uncounted_decoded_bytes = 4u << 10;
  /// Bytes of messages that are parsed but not done, over both ports. A person's limit exceeds what a message
  /// of 1 MiB can decode to (kMaxPayloadFields), a station's exceeds its longest OpenSession.
  BudgetLimits decoded{.person = 8u << 20, .people = 32u << 20, .station = 2u << 20, .server = 40u << 20};
  /// Bytes of replies that are being made or not read yet, over both ports. A reply being made reserves the
  /// maximum, 1 MiB, so a person has at most 12 such requests at work.
  BudgetLimits replies{.person = 12u << 20, .people = 96u << 20, .station = 8u << 20, .server = 128u << 20};
};

}  // namespace needlelab
