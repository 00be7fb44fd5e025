// SPDX-License-Identifier: MIT
using System;
using System.Collections.Generic;
using System.Globalization;
using System.IO;
using System.Text;

namespace SplatBus.Tests
{
    /// <summary>
    /// Tries all cases of a file of test vectors, and prints how many and what is wrong. Without a
    /// file it answers each line of hexadecimal digits: a payload by what is wrong with it, an init
    /// packet looked at whole, or by the bits of each number inside and the packet that our writer
    /// makes of it.
    /// </summary>
    static class Vectors
    {
        static readonly UTF8Encoding Utf8 = new UTF8Encoding(false);
        static int tried, wrong;

        static int Main(string[] arguments)
        {
            if (arguments.Length == 0) return Answer();
            if (arguments[0] == "--frames") return FrameLoop.Run(int.Parse(arguments[1], CultureInfo.InvariantCulture));
            if (arguments[0] == "--wakes") return Wakes.Run(int.Parse(arguments[1], CultureInfo.InvariantCulture));
            JsonValue file = new Json(10000000).Read(new ArraySegment<byte>(File.ReadAllBytes(arguments[0])));
            Spelt(file, "");
            int numbers = tried;
            string name = Member(file, "name").Text;
            tried = 0;
            if (name == "numbers" || name == "framing" || name == "packets" || name == "conventions" || name == "poses" || name == "images")
                foreach (JsonValue each in Member(file, "cases"))
                {
                    string what = Member(each, "name").Text;
                    if (name == "conventions" && !Member(each, "engine").Is("unity")) continue;
                    if (name == "images" && !Member(each, "quantity").Is("composite")) continue;
                    tried++;
                    if (name == "numbers") Number(each, what);
                    else if (name == "framing") Stream(each, what);
                    else if (name == "packets") Packet(each, what);
                    else if (name == "poses") Pixels.Taken(each, what);
                    else if (name == "images") Pixels.Composite(each, what);
                    else Axes(each, what);
                }
            Console.WriteLine("{0} numbers, {1} cases, {2} wrong", numbers, tried, wrong);
            return wrong == 0 ? 0 : 1;
        }

        static int Answer()
        {
            var json = new Json(Limits.MaxServerValues);
            var writer = new PacketWriter();
            for (string line; (line = Console.ReadLine()) != null;)
            {
                var told = new StringBuilder("taken ");
                try
                {
                    JsonValue read = json.Read(new ArraySegment<byte>(OfDigits(line)));
                    writer.Begin();
                    Members(read, writer, told);
                    if (InitPackets.IsOne(read)) InitPackets.Read(read);
                    foreach (byte each in writer.End()) told.Append(each.ToString("x2"));
                }
                catch (ProtocolException broken) { told.Length = 0; told.Append("refused: " + broken.Message); }
                Console.WriteLine(told);
            }
            return 0;
        }

        static void Members(JsonValue value, PacketWriter writer, StringBuilder bits)
        {
            foreach (JsonValue each in value)
            {
                writer.Name(each.Name);
                Again(each, writer, bits);
            }
        }

        static void Again(JsonValue value, PacketWriter writer, StringBuilder bits)
        {
            switch (value.Kind)
            {
                case JsonKind.Null: writer.Null(); break;
                case JsonKind.String: writer.Text(value.Text); break;
                case JsonKind.Number:
                    writer.Number(value.Number);
                    bits.AppendFormat("{0:x} ", BitConverter.DoubleToInt64Bits(value.Number));
                    break;
                case JsonKind.Array:
                    writer.BeginArray();
                    foreach (JsonValue each in value) Again(each, writer, bits);
                    writer.EndArray();
                    break;
                case JsonKind.Object:
                    writer.BeginObject();
                    Members(value, writer, bits);
                    writer.EndObject();
                    break;
                default: writer.Boolean(value.Kind == JsonKind.True); break;
            }
        }

        internal static void Check(bool holds, string what)
        {
            if (holds) return;
            wrong++;
            Console.WriteLine(what);
        }

        internal static JsonValue Member(JsonValue parent, string name)
        {
            JsonValue member;
            if (!parent.TryMember(name, out member)) throw new InvalidDataException("no member " + name);
            return member;
        }

        /// <summary>Every number that stands twice reads as the same double, and is printed so that it reads back.</summary>
        static void Spelt(JsonValue value, string where)
        {
            JsonValue @decimal, hex;
            if (value.TryMember("decimal", out @decimal) && value.TryMember("hex", out hex)) Same(@decimal, hex, where);
            else
                foreach (JsonValue each in value) Spelt(each, value.Kind == JsonKind.Object ? where + "/" + each.Name : where);
        }

        static void Same(JsonValue @decimal, JsonValue hex, string where)
        {
            if (@decimal.Kind == JsonKind.Array)
            {
                JsonValue.Inside beside = hex.GetEnumerator();
                foreach (JsonValue each in @decimal)
                {
                    Check(beside.MoveNext(), where + ": fewer in hex");
                    Same(each, beside.Current, where);
                }
                return;
            }
            if (@decimal.Kind != JsonKind.Number) return; // "inf"
            tried++;
            double exact = OfHex(hex.Text);
            Check(@decimal.Number == exact, where + ": " + hex.Text + " was read as " + @decimal.Number.ToString("R", CultureInfo.InvariantCulture));
            Check(Reads(Printed(exact)) == exact, where + ": " + hex.Text + " was printed as " + Printed(exact));
        }

        static void Number(JsonValue each, string what)
        {
            string verdict = Member(each, "verdict").Text;
            if (verdict == "printed")
            {
                double value = OfHex(Member(Member(each, "value"), "hex").Text);
                bool single = Member(each, "precision").Is("single");
                Check(Held(Reads(Printed(value)), single) == value, what + ": printed as " + Printed(value));
                foreach (JsonValue enough in Member(each, "enough")) Check(Held(Reads(enough.Text), single) == value, what + ": " + enough.Text);
                foreach (JsonValue few in Member(each, "too_few")) Check(Held(Reads(few.Text), single) != value, what + ": " + few.Text);
                return;
            }
            string payload = "{\"type\":\"camera_pose\",\"timestamp\":" + Text(Member(each, "spelling")) + "}";
            JsonValue read;
            bool taken = Try(payload, out read) && Member(read, "timestamp").Kind == JsonKind.Number;
            Check(verdict == "optional" || taken == (verdict == "accepted"), what + ": " + (taken ? "accepted" : "rejected"));
            if (taken && verdict != "rejected")
                Check(Member(read, "timestamp").Number == OfHex(Member(Member(each, "value"), "hex").Text), what + ": another value");
        }

        static void Stream(JsonValue each, string what)
        {
            byte[] stream = Bytes(Member(each, "stream"));
            var expected = new List<byte[]>();
            foreach (JsonValue packet in Member(each, "packets")) expected.Add(Bytes(packet));
            var cuts = new List<int> { 0 };
            foreach (JsonValue cut in Member(each, "cuts")) cuts.Add((int)cut.Number);
            cuts.Add(stream.Length);
            Divided(each, what, stream, expected, cuts);
            var everywhere = new List<int>();
            for (int at = 0; at <= stream.Length; at += stream.Length > 4096 ? 997 : 1) everywhere.Add(at);
            if (everywhere[everywhere.Count - 1] != stream.Length) everywhere.Add(stream.Length);
            Divided(each, what + ", byte by byte", stream, expected, everywhere);
        }

        static void Divided(JsonValue each, string what, byte[] stream, List<byte[]> expected, List<int> cuts)
        {
            var reader = new PacketReader();
            var found = new List<byte[]>();
            string outcome = "whole";
            try
            {
                for (int i = 1; i < cuts.Count; i++)
                    for (int at = cuts[i - 1]; at < cuts[i];)
                    {
                        ArraySegment<byte> room = reader.Room(), payload;
                        int some = Math.Min(room.Count, cuts[i] - at);
                        Buffer.BlockCopy(stream, at, room.Array, room.Offset, some);
                        reader.Received(some);
                        at += some;
                        while (reader.Next(out payload)) found.Add(payload.AsSpan().ToArray());
                    }
                if (!reader.IsBetweenPackets) outcome = "incomplete";
            }
            catch (ProtocolException broken)
            {
                outcome = "refused";
                Check(broken.Offset == (long)Member(each, "offset").Number, what + ": " + broken.Message);
            }
            Check(Member(each, "outcome").Is(outcome), what + ": " + outcome);
            Check(found.Count == expected.Count, what + ": " + found.Count + " packets");
            for (int i = 0; i < Math.Min(found.Count, expected.Count); i++)
                Check(found[i].AsSpan().SequenceEqual(expected[i]), what + ": another packet " + i);
        }

        static void Packet(JsonValue each, string what)
        {
            string payload = Member(each, "payload").Text;
            byte[] packet = OfDigits(Member(each, "hex").Text);
            var reader = new PacketReader();
            int passed = 0;
            ArraySegment<byte> found = default(ArraySegment<byte>);
            while (passed < packet.Length)
            {
                ArraySegment<byte> room = reader.Room();
                int some = Math.Min(room.Count, packet.Length - passed);
                Buffer.BlockCopy(packet, passed, room.Array, room.Offset, some);
                reader.Received(some);
                passed += some;
            }
            Check(reader.Next(out found) && Utf8.GetString(found.Array, found.Offset, found.Count) == payload, what + ": another payload");
            JsonValue read;
            Check(Try(payload, out read), what + ": rejected");
        }

        static void Axes(JsonValue each, string what)
        {
            Pose pose = OfMember(each, "pose"), expected = OfMember(each, "expected");
            Pose got = Member(each, "direction").Is("to_wire") ? UnityAxes.ToWire(pose) : UnityAxes.FromWire(pose);
            Check(got.X == expected.X && got.Y == expected.Y && got.Z == expected.Z, what + ": another position");
            double[] q = { got.QX, got.QY, got.QZ, got.QW }, e = { expected.QX, expected.QY, expected.QZ, expected.QW };
            bool same = true, opposite = true;
            for (int i = 0; i < 4; i++) { same &= q[i] == e[i]; opposite &= q[i] == -e[i]; }
            Check(same || opposite, what + ": another rotation");
        }

        internal static Pose OfMember(JsonValue each, string name)
        {
            JsonValue pose = Member(each, name);
            double[] p = new double[3], q = new double[4];
            if (!Member(Member(pose, "position"), "decimal").TryNumbers(p) || !Member(Member(pose, "rotation"), "decimal").TryNumbers(q))
                throw new InvalidDataException("no pose");
            return new Pose { X = p[0], Y = p[1], Z = p[2], QX = q[0], QY = q[1], QZ = q[2], QW = q[3] };
        }

        static bool Try(string payload, out JsonValue read)
        {
            read = default(JsonValue);
            try
            {
                read = new Json(Limits.MaxServerValues).Read(new ArraySegment<byte>(Utf8.GetBytes(payload)));
                return true;
            }
            catch (ProtocolException) { return false; }
        }

        static double Held(double value, bool single)
        {
            return single ? (float)value : value;
        }

        static double Reads(string spelling)
        {
            return Numbers.Read(Utf8.GetBytes(spelling));
        }

        static string Printed(double value)
        {
            var bytes = new byte[Numbers.MaxBytes];
            return Utf8.GetString(bytes, 0, Numbers.Write(value, bytes));
        }

        static string Text(JsonValue spelling)
        {
            if (spelling.Kind == JsonKind.String) return spelling.Text;
            var text = new StringBuilder();
            foreach (JsonValue piece in spelling) text.Insert(text.Length, Member(piece, "text").Text, Times(piece));
            return text.ToString();
        }

        static byte[] Bytes(JsonValue pieces)
        {
            var bytes = new List<byte>();
            foreach (JsonValue piece in pieces)
            {
                byte[] once = OfDigits(Member(piece, "hex").Text);
                for (int i = Times(piece); i > 0; i--) bytes.AddRange(once);
            }
            return bytes.ToArray();
        }

        static int Times(JsonValue piece)
        {
            JsonValue times;
            return piece.TryMember("times", out times) ? (int)times.Number : 1;
        }

        static byte[] OfDigits(string hex)
        {
            var bytes = new byte[hex.Length / 2];
            for (int i = 0; i < bytes.Length; i++) bytes[i] = byte.Parse(hex.Substring(2 * i, 2), NumberStyles.HexNumber);
            return bytes;
        }

        /// <summary>What C's %a printed: independent of how decimals are read.</summary>
        static double OfHex(string text)
        {
            bool negative = text[0] == '-';
            string[] parts = text.Substring(negative ? 3 : 2).Split('p');
            int point = parts[0].IndexOf('.');
            string digits = parts[0].Replace(".", "");
            int exponent = int.Parse(parts[1], CultureInfo.InvariantCulture) - (point < 0 ? 0 : 4 * (digits.Length - point));
            double value = long.Parse(digits, NumberStyles.HexNumber);
            for (; exponent > 0; exponent--) value *= 2;
            for (; exponent < 0; exponent++) value /= 2;
            return negative ? -value : value;
        }
    }
}
